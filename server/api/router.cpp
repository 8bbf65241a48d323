#include "server/api/router.h"

#include <algorithm>
#include <utility>

#include "proto/options/table.h"
#include "proto/text/client_texts.h"
#include "proto/text/near_miss.h"

namespace voxeld::api {
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

bool takes(const Route& route, std::string_view method) {
  return route.method == method || (route.method == "GET" && method == "HEAD");
}

constexpr std::string_view kRest = "{key}";  // a last segment that matches all others

// Sets `parameters`, unless null, to the segments that match {…}.
bool matches(const std::vector<std::string>& pattern, const std::vector<std::string>& path,
             std::vector<std::string>* parameters) {
  const bool has_rest = !pattern.empty() && pattern.back() == kRest;
  if (has_rest ? pattern.size() > path.size() : pattern.size() != path.size()) return false;
  if (parameters != nullptr) parameters->clear();
  for (size_t i = 0; i < pattern.size(); ++i) {
    if (pattern[i].starts_with('{')) {
      if (path[i].empty()) return false;
      if (parameters != nullptr) parameters->push_back(path[i]);
    } else if (pattern[i] != path[i]) {
      return false;
    }
  }
  if (has_rest && parameters != nullptr) {
    for (size_t i = pattern.size(); i < path.size(); ++i) parameters->back() += "/" + path[i];
  }
  return true;
}

Status check_query(const Route& route, const Head& head) {
  for (const auto& [name, value] : head.query) {
    if (std::ranges::find(route.query, name) == route.query.end()) {
      if (const Option* option = find_option(name)) return option_does_not_apply(*option);
      return unknown_name("parameter", name, route.query);
    }
  }
  return {};
}

}  // namespace

Router::Router(std::vector<Route> routes) {
  for (Route& route : routes) add(std::move(route));
}

void Router::add(Route route) {
  segments_.push_back(split_path(route.path));
  routes_.push_back(std::move(route));
}

const Route* Router::find(const Head& head) const {
  const Segments path = split_path(head.path);
  for (size_t i = 0; i < routes_.size(); ++i) {
    if (takes(routes_[i], head.method) && matches(segments_[i], path, nullptr)) return &routes_[i];
  }
  return nullptr;
}

Reply Router::dispatch(Request& request) const {
  const Segments path = split_path(request.head.path);
  const std::string& method = request.head.method;
  std::vector<std::string> allowed;
  for (size_t i = 0; i < routes_.size(); ++i) {
    const Route& route = routes_[i];
    if (!matches(segments_[i], path, &request.path_parameters)) continue;
    request.route = route.path;
    if (takes(route, method)) {
      if (const Status known = check_query(route, request.head); !known) {
        return Response::problem(known.error(), request.head.path, request.trace.trace_id);
      }
      request.body_bytes_max = route.body.bytes_max;
      return route.handler(request);
    }
    allowed.push_back(route.method);
    if (route.method == "GET") allowed.emplace_back("HEAD");
  }
  if (allowed.empty()) {
    return Response::problem(
        {ErrorCode::kNotFound, "there is no such resource", "", echoed(request.head.path)},
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

}  // namespace voxeld::api
