#include "server/http/access.h"

#include <utility>

namespace voxeld::http {
namespace {

bool is_public(std::string_view path) {
  return path == "/" || path == "/openapi.json";
}

// The token of "Bearer TOKEN" (RFC 6750); anything else gives a text that is no key.
std::string_view bearer_token(std::string_view authorization) {
  constexpr std::string_view kScheme = "Bearer ";
  const std::string_view scheme = authorization.substr(0, kScheme.size());
  const LessNoCase less;
  if (less(scheme, kScheme) || less(kScheme, scheme)) return {};
  std::string_view token = authorization.substr(kScheme.size());
  while (token.starts_with(' ')) token.remove_prefix(1);
  return token;
}

}  // namespace

Status Access::admit(Request& request) const {
  if (is_public(request.head.path)) return {};
  auto holder = keys_.admit(bearer_token(request.head.header("Authorization")));
  if (!holder) {
    return Error{ErrorCode::kUnauthorized, "this daemon needs a valid API key",
                 "Authorization: Bearer KEY", ""};
  }
  request.caller = std::move(holder->caller);
  request.key_id = std::move(holder->key_id);
  return {};
}

}  // namespace voxeld::http
