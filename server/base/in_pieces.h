// Long loops of short steps, and large vectors, with cancellation points (cancel_point.h).
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "server/base/cancel_point.h"

namespace voxeld {

// Steps between two cancellation points, if each takes less than a microsecond.
inline constexpr size_t kCancelSteps = 4096;

// Calls visit(item) for all items, with a cancellation point for each kCancelSteps.
template <typename T, typename Visit>
void for_each_in_pieces(std::span<const T> items, const Visit& visit) {
  while (!items.empty()) {
    cancel_point();
    const std::span<const T> piece = items.first(std::min(items.size(), kCancelSteps));
    for (const T& item : piece) visit(item);
    items = items.subspan(piece.size());
  }
}

// Grows a vector to `size`, with a cancellation point for each few megabytes: the first write of a
// page takes long. New elements are copies of `value`.
template <typename Vector>
void resize_in_pieces(Vector& vector, size_t size,
                      const typename Vector::value_type& value = typename Vector::value_type()) {
  constexpr size_t kGrowthBytes = size_t{4} << 20;
  constexpr size_t kGrowth = (kGrowthBytes - 1) / sizeof(value) + 1;
  vector.reserve(size);
  while (vector.size() < size) {
    cancel_point();
    vector.resize(std::min(size, vector.size() + kGrowth), value);
  }
}

}  // namespace voxeld
