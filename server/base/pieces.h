// Large arrays that are filled, copied and grown in pieces, with a cancellation point before each.
// At once, 300 MB take 100 ms or more, most of it in the kernel, which maps their pages.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "server/base/cancel_point.h"
#include "server/base/disk/mapped_pages.h"

namespace voxeld {

// Elements of a piece: 1 MiB of them.
template <typename T>
inline constexpr size_t kPieceElements = std::max<size_t>((size_t{1} << 20) / sizeof(T), 1);

// A cancellation point for every 4096th number, for steps of a few nanoseconds.
inline void cancel_point_at(size_t number) {
  if (number % 4096 == 0) cancel_point();
}

// Calls body(begin, end) for consecutive parts of [0, count), each of at most `piece` elements.
template <typename Body>
void in_pieces(size_t count, size_t piece, const Body& body) {
  for (size_t begin = 0; begin < count;) {
    cancel_point();
    const size_t end = begin + std::min(piece, count - begin);
    body(begin, end);
    begin = end;
  }
}

// Calls visit(item) for all items.
template <typename T, typename Visit>
void for_each_in_pieces(std::span<const T> items, const Visit& visit) {
  in_pieces(items.size(), 4096, [&](size_t begin, size_t end) {
    for (const T& item : items.subspan(begin, end - begin)) visit(item);
  });
}

// Frees an array, which is empty then. At once, 1 GB takes 130 ms.
template <typename T, typename Allocator>
void free_in_pieces(std::vector<T, Allocator>& values) {
  static_assert(std::is_trivially_destructible_v<T>);
  constexpr size_t kFreedBytes = size_t{1} << 26;
  std::vector<T, Allocator> freed;
  freed.swap(values);
  const size_t bytes = freed.size() * sizeof(T);
  if (bytes <= kFreedBytes) return;
  const auto* const first = reinterpret_cast<const uint8_t*>(freed.data());
  in_pieces(bytes, kFreedBytes, [&](size_t begin, size_t end) {
    drop_mapped_pages({first + begin, end - begin});
  });
}

// values.reserve(count). Until the elements are copied, the array is as before.
template <typename T, typename Allocator>
void reserve_in_pieces(std::vector<T, Allocator>& values, size_t count) {
  static_assert(std::is_trivially_copyable_v<T>);
  if (count <= values.capacity()) return;
  std::vector<T, Allocator> larger;
  larger.reserve(count);
  in_pieces(values.size(), kPieceElements<T>, [&](size_t begin, size_t end) {
    larger.insert(larger.end(), values.data() + begin, values.data() + end);
  });
  values.swap(larger);
  free_in_pieces(larger);
}

// Makes room for `more` elements, of an array that grows step by step.
template <typename T, typename Allocator>
void make_room_in_pieces(std::vector<T, Allocator>& values, size_t more) {
  const size_t count = values.size() + more;
  if (count <= values.capacity()) return;
  reserve_in_pieces(values, std::max<size_t>({count, 2 * values.size(), 8}));
}

// values.push_back(value), for an array that may become large.
template <typename T, typename Allocator>
void push_in_pieces(std::vector<T, Allocator>& values, const T& value) {
  if (values.size() == values.capacity()) {
    const T copy = value;  // it may be an element
    make_room_in_pieces(values, 1);
    values.push_back(copy);
    return;
  }
  values.push_back(value);
}

// Appends `more`, which is no part of the array.
template <typename T, typename Allocator>
void append_in_pieces(std::vector<T, Allocator>& values,
                      std::span<const std::type_identity_t<T>> more) {
  make_room_in_pieces(values, more.size());
  in_pieces(more.size(), kPieceElements<T>, [&](size_t begin, size_t end) {
    values.insert(values.end(), more.data() + begin, more.data() + end);
  });
}

// values.resize(count, value).
template <typename T, typename Allocator>
void resize_in_pieces(std::vector<T, Allocator>& values, size_t count, const T& value = {}) {
  if (count > values.size()) reserve_in_pieces(values, count);
  while (values.size() < count) {
    cancel_point();
    values.resize(values.size() + std::min(kPieceElements<T>, count - values.size()), value);
  }
  values.resize(count, value);
}

// The numbers from 0 to count - 1.
inline std::vector<uint32_t> numbers_in_pieces(size_t count) {
  std::vector<uint32_t> numbers;
  numbers.reserve(count);
  for (uint32_t i = 0; i < count; ++i) {
    cancel_point_at(i);
    numbers.push_back(i);
  }
  return numbers;
}

// A copy of an array.
template <typename T>
std::vector<T> copied_in_pieces(const T* values, size_t count) {
  std::vector<T> copy;
  copy.reserve(count);
  in_pieces(count, kPieceElements<T>, [&](size_t begin, size_t end) {
    copy.insert(copy.end(), values + begin, values + end);
  });
  return copy;
}

// std::sort() with a cancellation point in each comparison. If it throws, the values are lost.
template <typename Iterator, typename Less>
void cancellable_sort(Iterator begin, Iterator end, const Less& less) {
  std::sort(begin, end, [&](const auto& a, const auto& b) {
    cancel_point();
    return less(a, b);
  });
}

}  // namespace voxeld
