#include "server/api/access/access.h"

#include <string>
#include <utility>

namespace voxeld::api {
namespace {

// The token of "Bearer TOKEN" (RFC 6750); anything else gives a text that is no key.
std::string_view bearer_token(std::string_view authorization) {
  constexpr std::string_view kScheme = "Bearer ";
  const std::string_view scheme = authorization.substr(0, kScheme.size());
  const http::LessNoCase less;
  if (less(scheme, kScheme) || less(kScheme, scheme)) return {};
  std::string_view token = authorization.substr(kScheme.size());
  while (token.starts_with(' ')) token.remove_prefix(1);
  return token;
}

}  // namespace

Status Access::admit(Request& request) {
  std::optional<KeyRing::Holder> holder;
  if (is_signed_link(request.head)) {
    VOXELD_ASSIGN(const std::string key_id, links_.verify(request.head));
    holder = keys_.holder_of(key_id);
    if (!holder) return unknown_link();
    std::erase_if(request.head.query,
                  [](const auto& pair) { return is_link_parameter(pair.first); });
  } else {
    holder = keys_.admit(bearer_token(request.head.header("Authorization")));
  }
  if (!holder) return no_valid_key();
  request.caller = std::move(holder->caller);
  request.key_id = std::move(holder->key_id);
  if (request.key_id.empty()) return {};  // limits stand with keys
  const TenantLimits limits = keys_.limits_of(request.caller.tenant());
  if (limits.requests_per_minute == 0) return {};
  request.rate =
      limiter_.take(request.caller.tenant(), limits.requests_per_minute, RateLimiter::Clock::now());
  if (request.rate->admitted) return {};
  return Error{ErrorCode::kTooManyRequests, "this tenant asks too often; slow down",
               "at most " + rate_text(limits.requests_per_minute), "more"};
}

Error no_valid_key() {
  return {ErrorCode::kUnauthorized, "this daemon needs a valid API key",
          "Authorization: Bearer KEY", ""};
}

void add_rate_headers(const RateState& rate, Response& response) {
  const auto text = [](int64_t number) { return std::to_string(number); };
  response.headers["RateLimit-Policy"] =
      "\"requests\";q=" + text(rate.burst) + ";w=" + text(rate.window_s);
  response.headers["RateLimit"] = "\"requests\";r=" + text(rate.left) + ";t=" + text(rate.reset_s);
  if (!rate.admitted) response.headers["Retry-After"] = text(rate.retry_s);
}

}  // namespace voxeld::api
