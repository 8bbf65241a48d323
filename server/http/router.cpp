#include "server/http/router.h"

#include <algorithm>

namespace voxeld::http {
namespace {

std::vector<std::string> split_path(std::string_view path) {
  std::vector<std::string> segments;
  while (path.starts_with('/')) {
    path.remove_prefix(1);
    const std::string_view segment = path.substr(0, path.find('/'));
    segments.emplace_back(segment);
    path.remove_prefix(segment.size());
  }
  return segments;
}

bool matches(const std::vector<std::string>& pattern, const std::vector<std::string>& path,
             std::vector<std::string>& parameters) {
  if (pattern.size() != path.size()) return false;
  parameters.clear();
  for (size_t i = 0; i < path.size(); ++i) {
    if (pattern[i].starts_with('{')) {
      if (path[i].empty()) return false;
      parameters.push_back(path[i]);
    } else if (pattern[i] != path[i]) {
      return false;
    }
  }
  return true;
}

}  // namespace

void Router::add(std::string_view method, std::string_view name, RouteHandler handler) {
  routes_.push_back({std::string(method), std::string(name), split_path(name), std::move(handler)});
}

std::vector<Router::RouteName> Router::names() const {
  std::vector<RouteName> names;
  for (const Route& route : routes_) names.push_back({route.method, route.name});
  return names;
}

Response Router::dispatch(Request& request, std::string* route_name) const {
  const std::vector<std::string> path = split_path(request.head.path);
  const std::string& method = request.head.method;
  std::vector<std::string> allowed;
  for (const Route& route : routes_) {
    std::vector<std::string> parameters;
    if (!matches(route.segments, path, parameters)) continue;
    *route_name = route.name;
    if (route.method == method || (route.method == "GET" && method == "HEAD")) {
      request.path_parameters = std::move(parameters);
      return route.handler(request);
    }
    allowed.push_back(route.method);
    if (route.method == "GET") allowed.emplace_back("HEAD");
  }
  if (allowed.empty()) {
    return Response::problem({ErrorCode::kNotFound, "there is no such resource", "",
                              "\"" + request.head.path.substr(0, 120) + "\""},
                             request.head.path, request.trace.trace_id);
  }
  std::string allow = "OPTIONS";
  for (const std::string& name : allowed) allow += ", " + name;
  Response response;
  if (method == "OPTIONS") {
    response.status = 204;
  } else {
    response = Response::problem(
        {ErrorCode::kMethodNotAllowed, "this resource cannot do that", allow, method},
        request.head.path, request.trace.trace_id);
  }
  response.headers["Allow"] = allow;
  return response;
}

}  // namespace voxeld::http
