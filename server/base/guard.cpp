#include "server/base/guard.h"

#include <unistd.h>

#include "server/base/log.h"

namespace voxeld {

void log_exception(std::string_view what, const char* reason) noexcept {
  try {
    log::error("an exception was caught", {{"in", std::string(what)}, {"reason", reason}});
  } catch (const std::exception&) {
    // There is no memory even for a log line.
    constexpr std::string_view kText = "voxeld: out of memory\n";
    [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, kText.data(), kText.size());
  }
}

Error exception_error(const std::exception& failure) noexcept {
  try {
    return {ErrorCode::kInternal, failure.what(), "", ""};
  } catch (const std::exception&) {
    return {};
  }
}

}  // namespace voxeld
