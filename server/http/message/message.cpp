#include "server/http/message/message.h"

#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>

#include "proto/messages/job.h"
#include "proto/text/client_texts.h"
#include "proto/text/text_file.h"

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

std::string Head::media_type() const {
  const std::string_view whole = header("Content-Type");
  std::string type(whole.substr(0, whole.find(';')));
  std::ranges::transform(type, type.begin(), lower);
  while (type.ends_with(' ')) type.pop_back();
  return type;
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
  const bool is_short = instance.size() <= client_texts::kInstance.bytes_max;
  nlohmann::json body = problem_json(error, is_short ? instance : std::string_view());
  if (!trace_id.empty()) body["trace_id"] = trace_id;
  Response response = json(info_of(error.code).http_status,
                           body.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  response.headers["Content-Type"] = "application/problem+json";
  if (response.status == 401) response.headers["WWW-Authenticate"] = "Bearer realm=\"voxeld\"";
  if (response.status == 503 || response.status == 429) response.headers["Retry-After"] = "2";
  return response;
}

void add_vary(Response& response, std::string_view header) {
  std::string& vary = response.headers["Vary"];
  // Whole names, since Accept is a part of Accept-Encoding.
  if ((", " + vary + ", ").find(", " + std::string(header) + ", ") != std::string::npos) return;
  if (!vary.empty()) vary += ", ";
  vary += header;
}

std::string content_disposition(std::string_view filename) {
  constexpr std::string_view kHex = "0123456789ABCDEF";
  constexpr std::string_view kPlain = "!#$&+-.^_`|~";  // attr-char beside letters and digits
  std::string quoted, encoded;
  bool is_ascii = true;
  for (const char c : filename) {
    const auto byte = static_cast<unsigned char>(c);
    const bool is_control = byte < 0x20 || byte == 0x7f;
    is_ascii = is_ascii && byte < 0x80;
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += is_control || byte >= 0x80 ? '_' : c;
    if (std::isalnum(byte) != 0 || kPlain.find(c) != kPlain.npos) {
      encoded += c;
    } else {
      encoded += {'%', kHex[byte >> 4], kHex[byte & 15]};
    }
  }
  std::string text = "inline; filename=\"" + quoted + "\"";
  if (!is_ascii && is_utf8(filename)) text += "; filename*=UTF-8''" + encoded;
  return text;
}

std::string header_safe(std::string_view text) {
  std::string safe(text);
  std::ranges::replace_if(
      safe, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, '?');
  return safe;
}

}  // namespace voxeld::http
