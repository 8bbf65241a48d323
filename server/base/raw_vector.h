// A vector whose new elements are not initialized. Threads can then each write their own part of a
// large array first, which also maps its pages.
#pragma once

#include <memory>
#include <new>
#include <utility>
#include <vector>

namespace voxeld {

template <typename T>
struct DefaultInitAllocator : std::allocator<T> {
  template <typename U>
  struct rebind {
    using other = DefaultInitAllocator<U>;
  };
  using std::allocator<T>::allocator;

  template <typename U>
  void construct(U* place) noexcept {
    ::new (static_cast<void*>(place)) U;
  }
  template <typename U, typename... Arguments>
  void construct(U* place, Arguments&&... arguments) {
    ::new (static_cast<void*>(place)) U(std::forward<Arguments>(arguments)...);
  }
};

// resize() leaves new elements uninitialized: each must be written before it is read.
template <typename T>
using RawVector = std::vector<T, DefaultInitAllocator<T>>;

}  // namespace voxeld
