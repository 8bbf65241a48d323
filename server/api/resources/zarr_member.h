// Members of the zip of a Zarr store, which a worker wrote: found by their names, and not read.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "proto/result.h"

namespace voxeld::api {

// Bytes [offset, offset + bytes) of the archive.
struct ZipMember {
  uint64_t offset = 0, bytes = 0;
};

// The stored member of this name in an archive as ZipWriter::store() makes them. Takes time and
// touches memory in proportion to the directory, about 100 bytes a member. Errors: not-found if it
// has no such member; internal if it is no such archive.
Result<ZipMember> find_zip_member(std::span<const uint8_t> archive, std::string_view name);

}  // namespace voxeld::api
