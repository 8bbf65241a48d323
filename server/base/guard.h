// Threads whose uncaught exception would end the daemon.
#pragma once

#include <exception>
#include <string_view>

#include "proto/result.h"

namespace voxeld {

// Logs that `what` failed for this reason; never throws.
void log_exception(std::string_view what, const char* reason) noexcept;
// The same as an Error; without the reason when there is no memory for it.
Error exception_error(const std::exception& failure) noexcept;

// Runs `work`. What it throws (out of memory, mostly) is logged and ends nothing but this; then
// false.
template <typename Work>
bool guarded(std::string_view what, Work&& work) noexcept {
  try {
    work();
    return true;
  } catch (const std::exception& failure) {
    log_exception(what, failure.what());
  }
  return false;
}

}  // namespace voxeld
