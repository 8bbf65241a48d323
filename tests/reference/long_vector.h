// Vectors of the oracles that measure distances.
#pragma once

#include <array>

namespace voxeld::reference {

using LongVector = std::array<long double, 3>;

inline LongVector minus(const LongVector& a, const LongVector& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
inline long double dot(const LongVector& a, const LongVector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

}  // namespace voxeld::reference
