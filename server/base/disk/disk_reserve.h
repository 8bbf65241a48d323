// Free bytes that a worker process leaves on the disk of every file that it writes. The gateway has
// DiskRoom for its own files.
#pragma once

#include <cstdint>

#include "proto/result.h"

namespace voxeld {

// Free bytes of the file system that a descriptor is on; negative where it has none, as for a pipe.
using FreeBytes = int64_t (*)(int fd);
int64_t free_bytes_at(int fd);

// From now on, in this process. `bytes` 0, the default: none. `free_bytes`: for tests.
void keep_disk_reserve(int64_t bytes, FreeBytes free_bytes = free_bytes_at);

// A range of this length or longer is allocated before it is written, so that nobody else gets its
// room. Below it, several workers at once may use the reserve by what each of them writes.
inline constexpr int64_t kAllocatedBytesMin = int64_t{1} << 20;
// Reserves room for the bytes [offset, offset + bytes) of a file that are about to be written and
// where none is allocated yet. write_all() calls it. Errors: storage-full where less than the
// reserve would stay free.
Status reserve_room(int fd, int64_t offset, int64_t bytes);

}  // namespace voxeld
