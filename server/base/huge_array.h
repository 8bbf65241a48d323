// Zeroed memory in huge pages, for code that writes to words all over a tile: with small pages most
// of its writes would miss the TLB.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>

namespace voxeld {

class HugeArray {
 public:
  HugeArray() = default;
  explicit HugeArray(size_t words) : words_(allocate(words * sizeof(uint64_t))) {}

  uint64_t* data() const { return words_.get(); }

 private:
  struct Free {
    void operator()(void* memory) const { std::free(memory); }
  };

  static uint64_t* allocate(size_t bytes) {
    constexpr size_t kHugePage = size_t{2} << 20;
    const size_t rounded = (bytes + kHugePage - 1) / kHugePage * kHugePage;
    void* memory = std::aligned_alloc(kHugePage, rounded);
    if (memory == nullptr) throw std::bad_alloc();
    // Only a hint: if the kernel refuses it, small pages are used.
    ::madvise(memory, rounded, MADV_HUGEPAGE);
    std::memset(memory, 0, rounded);
    return static_cast<uint64_t*>(memory);
  }

  std::unique_ptr<uint64_t, Free> words_;
};

}  // namespace voxeld
