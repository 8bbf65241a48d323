// The largest integer that is not above a number, without the call of std::floor that processors
// before SSE4.1 need.
#pragma once

#include <cstdint>

namespace voxeld {

// |v| < 2^31.
inline int32_t floor_to_int(double v) {
  const auto truncated = static_cast<int32_t>(v);
  return truncated - (static_cast<double>(truncated) > v ? 1 : 0);
}

}  // namespace voxeld
