// CHECK aborts with file, line and a message. It guards conditions that no input can violate; for
// failures that a user can cause, use Result.
#pragma once

#include <string_view>

namespace voxeld {
[[noreturn]] void check_failed(const char* file, int line, const char* condition,
                               std::string_view detail);
}  // namespace voxeld

#define VOXELD_CHECK(condition, detail)                                 \
  do {                                                                  \
    if (!(condition)) [[unlikely]] {                                    \
      ::voxeld::check_failed(__FILE__, __LINE__, #condition, (detail)); \
    }                                                                   \
  } while (false)
