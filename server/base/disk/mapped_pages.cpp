#include "server/base/disk/mapped_pages.h"

#include <sys/mman.h>
#include <unistd.h>

namespace voxeld {

void drop_mapped_pages(std::span<const uint8_t> bytes) {
  const auto page = static_cast<size_t>(::sysconf(_SC_PAGESIZE));
  const size_t before = (page - reinterpret_cast<uintptr_t>(bytes.data()) % page) % page;
  if (before >= bytes.size()) return;
  const size_t whole = (bytes.size() - before) / page * page;
  // MADV_DONTNEED zeros anonymous private memory.
  (void)::madvise(const_cast<uint8_t*>(bytes.data()) + before, whole, MADV_DONTNEED);
}

}  // namespace voxeld
