#include "server/base/mapped_pages.h"

#include <sys/mman.h>
#include <unistd.h>

namespace voxeld {

void drop_mapped_pages(std::span<const uint8_t> bytes) {
  const auto page = static_cast<uintptr_t>(::sysconf(_SC_PAGESIZE));
  const auto address = reinterpret_cast<uintptr_t>(bytes.data());
  const uintptr_t first = (address + page - 1) / page * page;
  const uintptr_t last = (address + bytes.size()) / page * page;
  if (first >= last) return;
  // MADV_DONTNEED would zero private memory that is no file's.
  (void)::madvise(reinterpret_cast<void*>(first), last - first, MADV_DONTNEED);
}

}  // namespace voxeld
