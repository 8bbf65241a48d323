#include "server/http/message.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "proto/job.h"

namespace voxeld::http {
namespace {

char lower(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
}

}  // namespace

bool LessNoCase::operator()(std::string_view a, std::string_view b) const {
  return std::ranges::lexicographical_compare(a, b, {}, lower, lower);
}

std::string_view Head::header(std::string_view name) const {
  const auto it = headers.find(name);
  return it == headers.end() ? std::string_view() : std::string_view(it->second);
}

bool Head::keep_alive() const {
  std::string connection(header("Connection"));
  std::ranges::transform(connection, connection.begin(), lower);
  if (connection.find("close") != std::string::npos) return false;
  return minor >= 1 || connection.find("keep-alive") != std::string::npos;
}

std::optional<std::string> Request::query(std::string_view name) const {
  for (const auto& [key, value] : head.query) {
    if (key == name) return value;
  }
  return std::nullopt;
}

Response Response::json(int status, std::string text) {
  Response response;
  response.status = status;
  response.headers["Content-Type"] = "application/json";
  response.headers["Cache-Control"] = "no-store";
  response.body = std::move(text);
  return response;
}

Response Response::text(int status, std::string text) {
  Response response;
  response.status = status;
  response.headers["Content-Type"] = "text/plain; charset=utf-8";
  response.body = std::move(text);
  return response;
}

Response Response::problem(const Error& error, std::string_view instance,
                           std::string_view trace_id) {
  nlohmann::json body = problem_json(error, instance);
  if (!trace_id.empty()) body["trace_id"] = trace_id;
  Response response = json(info_of(error.code).http_status,
                           body.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  response.headers["Content-Type"] = "application/problem+json";
  if (response.status == 401) response.headers["WWW-Authenticate"] = "Bearer realm=\"voxeld\"";
  if (response.status == 415) response.headers["Accept-Encoding"] = "gzip, zstd";
  if (response.status == 503 || response.status == 429) response.headers["Retry-After"] = "2";
  return response;
}

std::string header_safe(std::string_view text) {
  std::string safe(text);
  std::ranges::replace_if(
      safe, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, '?');
  return safe;
}

}  // namespace voxeld::http
