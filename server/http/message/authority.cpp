#include "server/http/message/authority.h"

#include <arpa/inet.h>

#include <algorithm>
#include <charconv>

namespace voxeld {
namespace {

constexpr int kPortMax = 65535;

bool is_name_char(char c) {
  return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') ||
         std::string_view(".-_~").find(c) != std::string_view::npos;
}

std::optional<in_addr> ip4_of(std::string_view host) {
  in_addr address{};
  const bool is_one = ::inet_pton(AF_INET, std::string(host).c_str(), &address) == 1;
  return is_one ? std::optional(address) : std::nullopt;
}

std::optional<in6_addr> ip6_of(std::string_view host) {
  if (!host.starts_with('[') || !host.ends_with(']')) return std::nullopt;
  host = host.substr(1, host.size() - 2);
  in6_addr address{};
  const bool is_one = ::inet_pton(AF_INET6, std::string(host).c_str(), &address) == 1;
  return is_one ? std::optional(address) : std::nullopt;
}

bool is_loopback(const in_addr& address) {
  return (ntohl(address.s_addr) >> 24) == 127;
}

// ::ffff:127.0.0.1 is how dual-stack sockets write the IPv4 address.
bool is_loopback(const in6_addr& address) {
  if (IN6_IS_ADDR_V4MAPPED(&address)) return address.s6_addr[12] == 127;
  return IN6_IS_ADDR_LOOPBACK(&address) != 0;
}

std::string in_small_letters(std::string_view text) {
  std::string small(text);
  std::ranges::transform(small, small.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
  });
  return small;
}

}  // namespace

std::optional<Authority> parse_authority(std::string_view text) {
  Authority authority;
  const size_t bracket = text.starts_with('[') ? text.find(']') : 0;
  if (bracket == std::string_view::npos) return std::nullopt;
  const size_t colon = text.find(':', bracket);
  authority.host = in_small_letters(text.substr(0, colon));
  if (authority.host.size() > kHostBytesMax) return std::nullopt;
  const bool is_host = bracket != 0 ? ip6_of(authority.host).has_value()
                                    : std::ranges::all_of(authority.host, is_name_char);
  if (!is_host) return std::nullopt;
  if (colon == std::string_view::npos || colon + 1 == text.size()) return authority;
  const std::string_view port = text.substr(colon + 1);
  const bool are_digits = std::ranges::all_of(port, [](char c) { return c >= '0' && c <= '9'; });
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), authority.port);
  if (!are_digits || error != std::errc() || authority.port > kPortMax) return std::nullopt;
  return authority;
}

int Origin::port() const {
  if (authority.port != 0) return authority.port;
  return scheme == "https" ? 443 : 80;
}

std::optional<Origin> parse_origin(std::string_view text) {
  for (const std::string_view scheme : {"http", "https"}) {
    const std::string begin = std::string(scheme) + "://";
    if (!text.starts_with(begin)) continue;
    const auto authority = parse_authority(text.substr(begin.size()));
    if (!authority || authority->host.empty()) return std::nullopt;
    return Origin{std::string(scheme), *authority};
  }
  return std::nullopt;
}

bool is_address(std::string_view host) {
  return ip4_of(host) || ip6_of(host);
}

bool is_loopback_host(std::string_view host) {
  if (host == "localhost" || host == "localhost.") return true;
  if (const auto address = ip4_of(host)) return is_loopback(*address);
  const auto address = ip6_of(host);
  return address && is_loopback(*address);
}

bool is_unspecified_host(std::string_view host) {
  if (const auto address = ip4_of(host)) return address->s_addr == 0;
  const auto address = ip6_of(host);
  return address && IN6_IS_ADDR_UNSPECIFIED(&*address);
}

}  // namespace voxeld
