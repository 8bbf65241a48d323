#include "server/api/access/origin_guard.h"

#include <algorithm>

namespace voxeld::api {
namespace {

constexpr size_t kGotBytesMax = 120;

// Request headers of the routes beside those that every page may send.
constexpr std::string_view kAllowedHeaders =
    "Authorization, Content-Type, Content-Disposition, Content-Encoding, Idempotency-Key, "
    "If-None-Match, If-Range, Last-Event-ID, Prefer, Range, traceparent, X-Request-Id";
// Response headers of the routes beside those that every page may read.
constexpr std::string_view kExposedHeaders =
    "Accept-Ranges, Cache-Status, Content-Disposition, Content-Range, ETag, Location, "
    "Preference-Applied, RateLimit, RateLimit-Policy, Retry-After, Server-Timing, traceresponse, "
    "X-Request-Id, X-Voxeld-Content-Hash, X-Voxeld-Device, X-Voxeld-Grid, X-Voxeld-Job, "
    "X-Voxeld-Meta, X-Voxeld-Next, X-Voxeld-Pipeline, X-Voxeld-Sequence, X-Voxeld-Warnings";

std::string quoted(std::string_view text) {
  return "\"" + header_safe(text.substr(0, kGotBytesMax)) + "\"";
}

// A page that the daemon itself has served: the same host and port, whatever proxy made TLS of it.
bool is_own(const Origin& origin, const Authority& own) {
  const int own_port = own.port != 0 ? own.port : Origin{origin.scheme, own}.port();
  return origin.authority.host == own.host && origin.port() == own_port;
}

bool is_preflight(const Head& head) {
  return head.method == "OPTIONS" && !head.header("Origin").empty() &&
         !head.header("Access-Control-Request-Method").empty();
}

// Paths of the web page, which any page may link to.
bool is_of_page(std::string_view path) {
  return path == "/" || path == "/admin" || path.starts_with("/web/");
}

Error foreign_page(std::string_view header, std::string_view value) {
  return {ErrorCode::kForbidden, "a web page of another origin must not call this daemon",
          "the daemon's own origin, or one of --cors-origin",
          std::string(header) + ": " + quoted(value)};
}

}  // namespace

OriginGuard::OriginGuard(const OriginRules& rules, std::string_view listen)
    : takes_addresses_(!is_loopback_host(listen.substr(0, listen.rfind(':')))) {
  for (const std::string& host : rules.public_hosts) {
    if (const auto authority = parse_authority(host)) public_hosts_.push_back(authority->host);
  }
  for (const std::string& origin : rules.cors_origins) {
    if (const auto parsed = parse_origin(origin)) cors_origins_.push_back(*parsed);
  }
}

bool OriginGuard::is_own_host(std::string_view host) const {
  if (is_loopback_host(host) || std::ranges::count(public_hosts_, host) != 0) return true;
  return takes_addresses_ && is_address(host) && !is_unspecified_host(host);
}

bool OriginGuard::is_allowed(std::string_view text) const {
  const auto origin = parse_origin(text);
  return origin && std::ranges::any_of(cors_origins_, [&](const Origin& allowed) {
           return allowed.scheme == origin->scheme && is_own(*origin, allowed.authority);
         });
}

Status OriginGuard::check(const Head& head, bool is_open) const {
  if (is_open && !is_own_host(head.authority.host)) {
    return Error{ErrorCode::kForbidden,
                 "this daemon needs no API key, so it serves only its own names",
                 "as Host localhost, a loopback address or a name of --public-host",
                 quoted(head.header("Host"))};
  }
  if (is_of_page(head.path)) return {};
  const auto sent = head.headers.find("Origin");
  if (sent != head.headers.end()) {
    if (!is_open && !is_preflight(head)) return {};  // the page may not read the response
    const auto origin = parse_origin(sent->second);
    if ((origin && is_own(*origin, head.authority)) || is_allowed(sent->second)) return {};
    return foreign_page("Origin", sent->second);
  }
  const std::string_view site = head.header("Sec-Fetch-Site");
  if (is_open && site == "cross-site") return foreign_page("Sec-Fetch-Site", site);
  return {};
}

std::optional<Response> OriginGuard::preflight(const Head& head) const {
  if (!is_preflight(head) || !is_allowed(head.header("Origin"))) return std::nullopt;
  Response response;
  response.status = 204;
  response.headers["Access-Control-Allow-Methods"] = "GET, HEAD, POST, PATCH, DELETE";
  response.headers["Access-Control-Allow-Headers"] = kAllowedHeaders;
  response.headers["Access-Control-Max-Age"] = std::to_string(kPreflightSeconds);
  return response;
}

void OriginGuard::add_headers(const Head& head, Response& response) const {
  if (cors_origins_.empty()) return;
  add_vary(response, "Origin");
  const std::string_view origin = head.header("Origin");
  if (!is_allowed(origin)) return;
  response.headers["Access-Control-Allow-Origin"] = origin;
  if (!is_preflight(head)) response.headers["Access-Control-Expose-Headers"] = kExposedHeaders;
}

}  // namespace voxeld::api
