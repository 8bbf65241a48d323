// Routes: one table states for each its response, the query parameters and the body that it
// accepts, its work and the callers allowed.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "server/api/http_types.h"

namespace voxeld::api {

// The callers of a route.
enum class Audience {
  kTenants,  // callers with a valid key or signed link, everybody on a daemon without keys
  kAnyone,
};

// The work that a request brings. New work is refused while the daemon drains (shutting-down) or
// memory is short (queue-full), before its body is read.
enum class Work {
  kNone,      // reads or removes what is there
  kMayStart,  // may start a job, which the job service refuses while it drains
  kNew,
};

enum class BodyKind {
  kNone,
  kJson,    // application/json
  kUpload,  // a file
};

// The body that a request brings; more bytes are payload-too-large.
struct BodyRule {
  BodyKind kind = BodyKind::kNone;
  int64_t bytes_max = 0;
};

// Names of query parameters. A request with another one is unknown-option, before its handler runs.
using QueryNames = std::vector<std::string_view>;

using RouteHandler = std::function<Reply(Request&)>;

struct Route {
  // path of openapi.yaml: "/v1/jobs/{id}". A {key} at its end is the rest of the path, with its
  // slashes.
  std::string method, path;
  RouteHandler handler;
  QueryNames query = {};
  Work work = Work::kNone;
  BodyRule body = {};
  Audience audience = Audience::kTenants;
};

// Not thread-safe while routes are added; then thread-safe.
class Router {
 public:
  Router() = default;
  explicit Router(std::vector<Route> routes);
  void add(Route route);

  // The route of a request, HEAD by GET; null if there is none. Segments are compared one by one,
  // "{}" matches any one that is not empty, "{key}" at the end any rest; there are no regular
  // expressions.
  const Route* find(const Head& head) const;
  // Runs the handler of the request's route; sets `route`, `path_parameters` and `body_bytes_max`.
  // Responds to OPTIONS with Allow, and to unknown paths, methods and query parameters with 404,
  // 405 and 400.
  Reply dispatch(Request& request) const;
  const std::vector<Route>& routes() const { return routes_; }

 private:
  using Segments = std::vector<std::string>;
  std::vector<Route> routes_;
  std::vector<Segments> segments_;  // of each route's path
};

}  // namespace voxeld::api
