// Hosts, ports and origins, as in URLs and in the headers Host and Origin.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace voxeld {

// HOST[:PORT] of RFC 3986 section 3.2, without user information.
struct Authority {
  std::string host;  // in lower case; IPv6 addresses keep their brackets
  int port = 0;      // 0: absent
  bool operator==(const Authority&) const = default;
};

// Bytes of a host name; the DNS has no longer ones.
inline constexpr size_t kHostBytesMax = 255;

// Parses HOST[:PORT]. Returns nullopt for characters outside names and addresses, brackets without
// an IPv6 address, and ports above 65535. Stricter than the RFC: names consist of letters, digits,
// '.', '-', '_' and '~'. The host may be empty, as in the header Host.
std::optional<Authority> parse_authority(std::string_view text);

// An origin such as "http://localhost:3000" (RFC 6454), as browsers send it.
struct Origin {
  std::string scheme;  // http or https
  Authority authority;
  bool operator==(const Origin&) const = default;
  // The port of the origin, or the scheme's default.
  int port() const;
};
// Returns nullopt for "null", "*", other schemes, a path, and an invalid or empty authority.
std::optional<Origin> parse_origin(std::string_view text);

// Whether the host is an IPv4 address or a bracketed IPv6 address, not a name.
bool is_address(std::string_view host);
// Whether the host is "localhost" or a loopback address. Names that only resolve to one do not
// count.
bool is_loopback_host(std::string_view host);
// Whether the host is 0.0.0.0 or [::]. Listening there means all addresses; connecting there means
// this machine.
bool is_unspecified_host(std::string_view host);

}  // namespace voxeld
