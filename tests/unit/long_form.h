// Parameter lists of tests that the gate runs in part and the long form (ctest's NAME.whole) whole.
#pragma once

#include <cstdlib>
#include <string_view>
#include <utility>
#include <vector>

namespace voxeld {

// True if VOXELD_LONG is 1.
inline bool long_form() {
  const char* value = std::getenv("VOXELD_LONG");
  return value != nullptr && std::string_view(value) == "1";
}

// The list of the form that runs. That of the gate leaves out repetition, no kind of fault.
template <typename T>
std::vector<T> by_form(std::vector<T> gate, std::vector<T> whole) {
  return long_form() ? std::move(whole) : std::move(gate);
}

}  // namespace voxeld
