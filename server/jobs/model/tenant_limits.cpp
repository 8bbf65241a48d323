#include "server/jobs/model/tenant_limits.h"

#include "proto/text/client_texts.h"
#include "proto/text/number_text.h"

namespace voxeld {
namespace {

constexpr int64_t kSecondsPerMinute = 60;

}  // namespace

Result<int64_t> parse_rate(std::string_view text) {
  const std::string_view unit =
      text.size() > 2 && text[text.size() - 2] == '/' ? text.substr(text.size() - 2) : "";
  const std::string_view digits = text.substr(0, text.size() - unit.size());
  const int64_t factor = unit == "/m" ? 1 : kSecondsPerMinute;
  const auto value = parse_digits<int64_t>(digits);
  const bool is_unit = unit.empty() || unit == "/s" || unit == "/m";
  if (value && is_unit && *value <= kRequestsPerMinuteMax / factor) return *value * factor;
  return Error{ErrorCode::kInvalidOption, "rate",
               "requests per second (10 or 10/s) or minute (30/m)", echoed(text)};
}

std::string rate_text(int64_t requests_per_minute) {
  if (requests_per_minute == 0) return "-";
  if (requests_per_minute % kSecondsPerMinute != 0) {
    return std::to_string(requests_per_minute) + "/m";
  }
  return std::to_string(requests_per_minute / kSecondsPerMinute) + "/s";
}

}  // namespace voxeld
