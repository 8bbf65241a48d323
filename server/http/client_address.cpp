#include "server/http/client_address.h"

#include <algorithm>
#include <array>
#include <string_view>

namespace voxeld::http {
namespace {

// Headers in which proxies name their client; any client can send them.
constexpr std::array<std::string_view, 7> kForwarded = {
    "X-Forwarded-For",  "X-Forwarded-Host", "X-Forwarded-Proto", "X-Forwarded-Port",
    "X-Forwarded-User", "X-Real-IP",        "Forwarded"};

// Characters of addresses only; anything else is not an address.
bool is_address(std::string_view text) {
  return !text.empty() && text.size() <= 45 &&
         text.find_first_not_of("0123456789abcdefABCDEF.:") == text.npos;
}

}  // namespace

std::string take_client_address(Head& head, const std::string& peer,
                                const std::vector<std::string>& trusted_proxies) {
  const auto is_trusted = [&](std::string_view address) {
    return std::ranges::count(trusted_proxies, address) != 0;
  };
  std::string client = peer;
  std::string_view left = head.header("X-Forwarded-For");
  // From the back: each proxy appends its own client.
  while (is_trusted(client) && !left.empty()) {
    const size_t comma = left.rfind(',');
    std::string_view last = comma == left.npos ? left : left.substr(comma + 1);
    left = comma == left.npos ? std::string_view() : left.substr(0, comma);
    while (last.starts_with(' ')) last.remove_prefix(1);
    while (last.ends_with(' ')) last.remove_suffix(1);
    if (!is_address(last)) break;
    client = last;
  }
  for (const std::string_view name : kForwarded) {
    if (const auto it = head.headers.find(name); it != head.headers.end()) head.headers.erase(it);
  }
  return client;
}

}  // namespace voxeld::http
