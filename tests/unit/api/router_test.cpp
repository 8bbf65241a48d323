// Routes: which handler a request gets, and the table of all of them against openapi.yaml.
#include "server/api/router.h"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "server/api/openapi_json.h"
#include "server/api/routes.h"
#include "server/http/message/head_parser.h"

namespace voxeld::api {
namespace {

Request request_of(const std::string& method, const std::string& target) {
  Request request;
  request.head = http::parse_head(method + " " + target + " HTTP/1.1\r\nHost: h\r\n\r\n").value();
  return request;
}

// Routes that respond with their path and its parameters.
Router example() {
  const auto handler = [](Request& request) {
    std::string text = request.route;
    for (const std::string& parameter : request.path_parameters) text += " " + parameter;
    return Response::text(200, text);
  };
  return Router({{"GET", "/hello", handler},
                 {"POST", "/echo", handler, {"limit", "after"}, Work::kNew},
                 {"GET", "/v1/jobs/{id}", handler},
                 {"DELETE", "/v1/jobs/{id}", handler},
                 {"GET", "/v1/jobs/{id}/frames/{index}", handler},
                 {"GET", "/v1/grids/{id}/zarr/{key}", handler}});
}

Response dispatch(const std::string& method, const std::string& target) {
  Request request = request_of(method, target);
  Reply reply = example().dispatch(request);
  return std::get<Response>(std::move(reply.next));
}

std::string text_of(const Response& response) {
  return std::get<std::string>(response.body);
}

TEST(Router, a_segment_in_braces_takes_any_text_that_is_not_empty) {
  EXPECT_EQ(text_of(dispatch("GET", "/v1/jobs/j-1")), "/v1/jobs/{id} j-1");
  EXPECT_EQ(text_of(dispatch("GET", "/v1/jobs/j-1/frames/7")),
            "/v1/jobs/{id}/frames/{index} j-1 7");
  for (const char* path :
       {"/v1/jobs/", "/v1/jobs//", "/v1/jobs", "/v1", "//", "/hello/", "/Hello"}) {
    EXPECT_EQ(dispatch("GET", path).status, 404) << path;
  }
}

TEST(Router, a_key_at_the_end_takes_the_rest_of_the_path) {
  EXPECT_EQ(text_of(dispatch("GET", "/v1/grids/g/zarr/zarr.json")),
            "/v1/grids/{id}/zarr/{key} g zarr.json");
  EXPECT_EQ(text_of(dispatch("GET", "/v1/grids/g/zarr/0/c/1/2/3")),
            "/v1/grids/{id}/zarr/{key} g 0/c/1/2/3");
  EXPECT_EQ(text_of(dispatch("GET", "/v1/grids/g/zarr/0//c/")),
            "/v1/grids/{id}/zarr/{key} g 0//c/");
  for (const char* path : {"/v1/grids/g/zarr", "/v1/grids/g/zarr/", "/v1/grids/g/zarr//0"}) {
    EXPECT_EQ(dispatch("GET", path).status, 404) << path;
  }
}

TEST(Router, an_unknown_path_is_not_found) {
  const Response response = dispatch("GET", "/nothing");
  EXPECT_EQ(response.status, 404);
  const auto body = nlohmann::json::parse(text_of(response));
  EXPECT_EQ(body["code"], "not-found");
  EXPECT_EQ(body["instance"], "/nothing");
}

TEST(Router, a_wrong_method_gets_the_allowed_ones) {
  const Response refused = dispatch("PUT", "/v1/jobs/j-1");
  EXPECT_EQ(refused.status, 405);
  EXPECT_EQ(refused.headers.at("Allow"), "OPTIONS, GET, HEAD, DELETE");
  EXPECT_EQ(nlohmann::json::parse(text_of(refused))["code"], "method-not-allowed");
  const Response options = dispatch("OPTIONS", "/echo");
  EXPECT_EQ(options.status, 204);
  EXPECT_EQ(options.headers.at("Allow"), "OPTIONS, POST");
}

TEST(Router, a_head_request_has_the_route_of_get) {
  EXPECT_EQ(text_of(dispatch("HEAD", "/hello")), "/hello");
  EXPECT_EQ(dispatch("HEAD", "/echo").status, 405);
}

TEST(Router, find_gives_the_route_before_anything_runs) {
  const Router router = example();
  const Route* found = router.find(request_of("POST", "/echo").head);
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(found->work, Work::kNew);
  EXPECT_EQ(router.find(request_of("GET", "/echo").head), nullptr);
}

TEST(Router, a_query_parameter_that_the_route_does_not_take_is_unknown) {
  EXPECT_EQ(dispatch("POST", "/echo?limit=1&after=x").status, 200);
  const Response near = dispatch("POST", "/echo?limit=1&limti=2");
  EXPECT_EQ(near.status, 400);
  const auto body = nlohmann::json::parse(text_of(near));
  EXPECT_EQ(body["code"], "unknown-option");
  EXPECT_EQ(body["detail"], "unknown parameter 'limti'; did you mean 'limit'?");
  const auto far = nlohmann::json::parse(text_of(dispatch("HEAD", "/hello?page=%FF")));
  EXPECT_EQ(far["detail"], "unknown parameter 'page'");
  EXPECT_EQ(far["expected"], "none");
  EXPECT_EQ(dispatch("GET", "/hello?%FF=1").status, 400);
}

TEST(Router, a_path_of_8_kilobytes_is_looked_up_like_any_other) {
  EXPECT_EQ(dispatch("GET", "/" + std::string(8000, 'a')).status, 404);
  std::string deep;
  for (int i = 0; i < 4000; ++i) deep += "/a";
  EXPECT_EQ(dispatch("GET", deep).status, 404);
}

// --- the table of public routes

struct Table : public ::testing::Test {
  // No handler is called, so that none needs the API.
  alignas(Api) std::array<std::byte, sizeof(Api)> storage{};
  const std::vector<Route> routes = public_routes(reinterpret_cast<Api&>(storage), 1000);
  const nlohmann::json document = nlohmann::json::parse(openapi_json());

  const nlohmann::json& operation(const Route& route) const {
    std::string method;
    for (const char c : route.method) method += static_cast<char>(c + 32);
    return document.at("paths").at(route.path).at(method);
  }
  // The value itself, or what its $ref names.
  const nlohmann::json& resolved(const nlohmann::json& value) const {
    if (!value.contains("$ref")) return value;
    return document.at(nlohmann::json::json_pointer(value["$ref"].get<std::string>().substr(1)));
  }
};

TEST_F(Table, has_the_operations_of_openapi_yaml_and_no_others) {
  std::set<std::string> in_table, documented;
  for (const Route& route : routes) {
    EXPECT_TRUE(in_table.insert(route.method + " " + route.path).second) << route.path << " twice";
  }
  for (const auto& [path, operations] : document["paths"].items()) {
    for (const auto& [method, operation] : operations.items()) {
      if (method == "parameters") continue;
      std::string upper;
      for (const char c : method) upper += static_cast<char>(c - 32);
      documented.insert(upper + " " + path);
    }
  }
  EXPECT_EQ(in_table, documented);
}

TEST_F(Table, takes_the_query_parameters_of_openapi_yaml) {
  for (const Route& route : routes) {
    std::set<std::string> documented;
    for (const auto& list : {document["paths"][route.path], operation(route)}) {
      if (!list.contains("parameters")) continue;
      for (const auto& one : list["parameters"]) {
        const auto& parameter = resolved(one);
        if (parameter.at("in") == "query") documented.insert(parameter.at("name"));
      }
    }
    const std::set<std::string> taken(route.query.begin(), route.query.end());
    EXPECT_EQ(taken, documented) << route.method << " " << route.path;
  }
}

TEST_F(Table, has_an_operation_id_a_tag_and_a_summary_for_each_route) {
  std::set<std::string> ids;
  for (const Route& route : routes) {
    const auto& documented = operation(route);
    EXPECT_TRUE(ids.insert(documented.at("operationId").get<std::string>()).second) << route.path;
    EXPECT_EQ(documented.at("tags").size(), 1U) << route.path;
    EXPECT_FALSE(documented.at("summary").get<std::string>().empty()) << route.path;
  }
}

TEST_F(Table, states_the_required_rights_as_openapi_yaml_does) {
  for (const Route& route : routes) {
    const auto& documented = operation(route);
    const bool is_public = documented.contains("security") && documented["security"].empty();
    EXPECT_EQ(route.audience == Audience::kAnyone, is_public) << route.method << " " << route.path;
  }
}

TEST_F(Table, takes_the_bodies_of_openapi_yaml) {
  for (const Route& route : routes) {
    const auto& documented = operation(route);
    const bool has_body = documented.contains("requestBody");
    EXPECT_EQ(route.body.kind != BodyKind::kNone, has_body) << route.method << " " << route.path;
    EXPECT_EQ(route.body.bytes_max > 0, has_body) << route.path;
    if (!has_body) continue;
    const auto& content = resolved(documented.at("requestBody")).at("content");
    const bool is_json = content.size() == 1 && content.contains("application/json");
    EXPECT_EQ(route.body.kind == BodyKind::kJson, is_json) << route.path;
  }
}

TEST_F(Table, documents_503_for_each_route_that_brings_or_may_start_work) {
  for (const Route& route : routes) {
    if (route.work == Work::kNone) continue;
    EXPECT_TRUE(operation(route)["responses"].contains("503")) << route.method << " " << route.path;
  }
}

TEST_F(Table, reading_routes_bring_no_new_work_and_posts_do) {
  for (const Route& route : routes) {
    EXPECT_EQ(route.method == "POST", route.work == Work::kNew) << route.path;
  }
}

}  // namespace
}  // namespace voxeld::api
