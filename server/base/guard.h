// Guards threads in which an uncaught exception would end the daemon.
#pragma once

#include <exception>
#include <string_view>

#include "proto/result.h"

namespace voxeld {

// Logs that `what` failed for this reason; never throws.
void log_exception(std::string_view what, const char* reason) noexcept;
// The exception as an Error; without the reason if there is no memory for it.
Error exception_error(const std::exception& failure) noexcept;

// Runs `work`. An exception (mostly out of memory) is logged and ends only this call, which then
// returns false.
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

// For a step that nobody would do later: a second try finds memory more often than not.
template <typename Work>
bool guarded_twice(std::string_view what, const Work& work) noexcept {
  return guarded(what, work) || guarded(what, work);
}

}  // namespace voxeld
