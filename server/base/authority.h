// Hosts, ports and origins, as URLs and the headers Host and Origin write them.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace voxeld {

// HOST[:PORT] of RFC 3986 section 3.2, without user information.
struct Authority {
  std::string host;  // in small letters; IPv6 addresses keep their brackets
  int port = 0;      // 0: not given
  bool operator==(const Authority&) const = default;
};

// Bytes of a host; longer names do not exist in the DNS.
inline constexpr size_t kHostBytesMax = 255;

// nullopt where the text is none: a character that neither names nor addresses have, brackets
// without an IPv6 address, a port above 65535. Stricter than the RFC: names consist of letters,
// digits, '.', '-', '_' and '~'. The host may be empty, as the header Host may.
std::optional<Authority> parse_authority(std::string_view text);

// "http://localhost:3000" (RFC 6454), as browsers send it.
struct Origin {
  std::string scheme;  // http or https
  Authority authority;
  bool operator==(const Origin&) const = default;
  // The port of the URL, given or not.
  int port() const;
};
// nullopt for "null", "*", other schemes, a path, and what is no authority or an empty one.
std::optional<Origin> parse_origin(std::string_view text);

// Whether the host is an IPv4 address or a bracketed IPv6 address, and not a name.
bool is_address(std::string_view host);
// "localhost" or an address of this machine alone; names that only resolve to one do not count.
bool is_loopback_host(std::string_view host);
// 0.0.0.0 and [::]: listening there means all addresses, and connecting there this machine.
bool is_unspecified_host(std::string_view host);

}  // namespace voxeld
