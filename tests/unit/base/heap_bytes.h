// Memory that this process has allocated.
#pragma once

#include <malloc.h>

#include <cstdint>

namespace voxeld::testing {

// Bytes of the heap in use, in all of its arenas. A sanitizer has a heap of its own, of which this
// counts nothing.
inline int64_t heap_bytes() {
  const struct mallinfo2 heap = ::mallinfo2();
  return static_cast<int64_t>(heap.uordblks + heap.hblkhd);
}

}  // namespace voxeld::testing
