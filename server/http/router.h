// Method and path -> handler. Patterns are segments, "{}" takes one; no regular expressions.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "server/http/message.h"

namespace voxeld::http {

using RouteHandler = std::function<Response(Request&)>;

class Router {
 public:
  // `name` is the path of openapi.yaml: "/v1/jobs/{id}".
  void add(std::string_view method, std::string_view name, RouteHandler handler);
  // Answers HEAD by GET, OPTIONS with Allow; 404 and 405 as problems. Sets `route` to the name.
  Response dispatch(Request& request, std::string* route) const;

  struct RouteName {
    std::string method, name;
  };
  std::vector<RouteName> names() const;

 private:
  struct Route {
    std::string method, name;
    std::vector<std::string> segments;
    RouteHandler handler;
  };
  std::vector<Route> routes_;
};

}  // namespace voxeld::http
