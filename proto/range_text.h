// Texts of number ranges in errors, also for a range of one number or of none.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace voxeld {

// The range [low, high] in words: "0 to 3"; "-1" where it is the only one.
inline std::string range_text(int64_t low, int64_t high) {
  return low == high ? std::to_string(low) : std::to_string(low) + " to " + std::to_string(high);
}

// The range of indices of `count`: "0 to 3", "0", and "none, as there are no frames" for none.
inline std::string index_text(uint64_t count, std::string_view things) {
  if (count == 0) return "none, as there are no " + std::string(things);
  return range_text(0, static_cast<int64_t>(count - 1));
}

}  // namespace voxeld
