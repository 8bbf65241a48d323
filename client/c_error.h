// Errors of the library's functions in C.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string_view>

namespace voxeld {

// Copies the text to `error`, cut to error_size bytes with a zero byte at the end.
inline void set_error(std::string_view text, char* error, size_t error_size) {
  if (error == nullptr || error_size == 0) return;
  const size_t length = std::min(text.size(), error_size - 1);
  std::copy_n(text.data(), length, error);
  error[length] = '\0';
}

}  // namespace voxeld
