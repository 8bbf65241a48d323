// The host names that a listener serves, and the web pages that may call it.
//
// A browser reaches a daemon on loopback, or behind a firewall, for every page that it shows, and
// sends a page's request before it checks whether that page may read the response. Without API keys
// nothing else tells such a request from one of the machine's user. So a request must name the
// daemon by a host that no stranger can point at it (DNS rebinding), and must not come from a page
// of another origin. With keys a page has none of them unless somebody gives it one; then the
// browser asks here whether the page's origin may read the responses (CORS, fetch.spec.whatwg.org).
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/api/http_types.h"
#include "server/http/message/authority.h"

namespace voxeld::api {

// Seconds for which a browser may cache the response to a preflight.
inline constexpr int kPreflightSeconds = 600;

struct OriginRules {
  std::vector<std::string> public_hosts = {};  // beside loopback: names without a port
  std::vector<std::string> cors_origins = {};  // "https://app.example.org"; never all of them
};

// Immutable, and so thread-safe.
class OriginGuard {
 public:
  // `listen` is HOST:PORT of the listener. One that is not on loopback is called by any address of
  // the machine as well: an address cannot be rebound.
  OriginGuard(const OriginRules& rules, std::string_view listen);

  // `is_open`: no API key is needed. Errors: forbidden, for a Host that is not the daemon's, for an
  // Origin that is neither the daemon's own nor allowed, and for Sec-Fetch-Site: cross-site; with
  // keys for the preflight of an Origin that is not allowed alone. The web page ("/", "/admin",
  // "/web/") accepts links from any page.
  Status check(const Head& head, bool is_open) const;
  // The response to the preflight of an allowed origin, which has no key; nullopt for others.
  std::optional<Response> preflight(const Head& head) const;
  // Allows the requesting page to read the response, and adds Vary: Origin for caches.
  void add_headers(const Head& head, Response& response) const;

 private:
  bool is_own_host(std::string_view host) const;
  bool is_allowed(std::string_view origin) const;

  std::vector<std::string> public_hosts_;
  std::vector<Origin> cors_origins_;
  const bool takes_addresses_;
};

}  // namespace voxeld::api
