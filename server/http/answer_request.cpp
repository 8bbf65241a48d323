#include "server/http/answer_request.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <random>
#include <string_view>
#include <utility>

#include "proto/client_texts.h"
#include "server/base/log.h"
#include "server/http/body_reader.h"
#include "server/http/head_parser.h"

namespace voxeld::http {
namespace {

// What proxies say of whom they speak for; anybody can.
constexpr std::array<std::string_view, 7> kForwarded = {
    "X-Forwarded-For",  "X-Forwarded-Host", "X-Forwarded-Proto", "X-Forwarded-Port",
    "X-Forwarded-User", "X-Real-IP",        "Forwarded"};

std::string new_request_id() {
  thread_local std::mt19937_64 random{std::random_device{}()};
  std::array<char, 20> text{};
  std::snprintf(text.data(), text.size(), "r-%016llx", static_cast<unsigned long long>(random()));
  return text.data();
}

bool is_plain_id(std::string_view id) {
  return !id.empty() && id.size() <= client_texts::kRequestId.bytes_max &&
         id.find_first_not_of(
             "abcdefghijklmnopqrstuvwxyz"
             "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
             "0123456789-_.") == id.npos;
}

// Of the letters that addresses have; anything else is no address.
bool is_address(std::string_view text) {
  return !text.empty() && text.size() <= 45 &&
         text.find_first_not_of("0123456789abcdefABCDEF.:") == text.npos;
}

Error long_head(size_t bytes) {
  const bool is_long = bytes > kHeadBytesMax;
  return {
      ErrorCode::kBadRequest,
      is_long ? "the head of the request is too long" : "bare line feed in the head of the request",
      is_long ? "at most " + std::to_string(kHeadBytesMax) + " bytes" : "lines that end in CRLF",
      ""};
}

Response refuse(Request& request) {
  return Response::problem(
      {ErrorCode::kShuttingDown, "the daemon is shutting down; try again", "", ""},
      request.head.path, request.trace.trace_id);
}

// False in `keep` when the request's body was not read to its end.
Response run_handler(Client& client, const Handler& handler, Request& request) {
  Response response;
  try {
    response = handler(request);
  } catch (const std::exception& e) {
    // Out of memory and the like: one answer fails, the daemon goes on. What it says may be of
    // others' business.
    log::error("a handler failed", {{"id", request.request_id}, {"error", e.what()}});
    response = Response::problem(
        {ErrorCode::kInternal, "unexpected failure; the daemon's log has it by this request's id",
         "", ""},
        request.head.path, request.trace.trace_id);
  }
  response.headers["traceresponse"] = traceparent_text(request.trace);
  client.record.bytes_in = request.body->bytes_read();
  client.record.key_id = request.key_id;
  client.record.route = std::move(request.route);
  if (!request.key_id.empty()) client.record.tenant = request.caller.tenant();
  client.keep = request.body->finished() && request.head.keep_alive();
  return response;
}

}  // namespace

std::string take_client_address(Head& head, const std::string& peer,
                                const std::vector<std::string>& trusted_proxies) {
  const auto is_trusted = [&](std::string_view address) {
    return std::ranges::count(trusted_proxies, address) != 0;
  };
  std::string client = peer;
  std::string_view left = head.header("X-Forwarded-For");
  // From the back: each proxy adds whom it was asked by.
  while (is_trusted(client) && !left.empty()) {
    const size_t comma = left.rfind(',');
    std::string_view last = comma == left.npos ? left : left.substr(comma + 1);
    left = comma == left.npos ? std::string_view() : left.substr(0, comma);
    while (last.starts_with(' ')) last.remove_prefix(1);
    while (last.ends_with(' ')) last.remove_suffix(1);
    if (!is_address(last)) break;
    client = last;
  }
  for (const std::string_view name : kForwarded) {
    if (const auto it = head.headers.find(name); it != head.headers.end()) head.headers.erase(it);
  }
  return client;
}

Response answer_request(Client& client, const Handler& handler, const FrontConfig& config) {
  ExchangeRecord& record = client.record;
  record.peer = client.connection.peer();
  client.keep = false;
  Response response;
  if (!client.head) {
    response = Response::problem(long_head(client.connection.buffer().size()), "");
  } else if (!*client.head) {
    response = Response::problem(client.head->error(), "");
  } else {
    Request request;
    request.head = std::move(client.head->value());
    const Head& head = request.head;
    record.head = &client.head->value();  // that is put back below
    record.peer =
        take_client_address(request.head, client.connection.peer(), config.trusted_proxies);
    BodyReader body(client.connection, head);
    request.body = &body;
    request.client_gone = [&] { return client.connection.peer_closed(); };
    const std::string_view given = head.header("X-Request-Id");
    request.request_id = is_plain_id(given) ? std::string(given) : new_request_id();
    record.request_id = request.request_id;
    const auto parent = parse_traceparent(head.header("traceparent"));
    request.trace = parent ? child_span(*parent) : new_trace();
    record.trace_id = request.trace.trace_id;
    static const Handler kRefuse = refuse;
    response = run_handler(client, client.is_refused ? kRefuse : handler, request);
    client.head->value() = std::move(request.head);
  }
  if (record.request_id.empty()) record.request_id = new_request_id();
  record.status = response.status;
  response.headers["X-Request-Id"] = record.request_id;
  response.headers["X-Content-Type-Options"] = "nosniff";
  const bool is_http_1_0 = client.head && *client.head && client.head->value().minor == 0;
  // The connection's end is that of a body whose length nobody knows.
  const bool ends_by_close = std::holds_alternative<StreamBody>(response.body) ||
                             (is_http_1_0 && std::holds_alternative<PieceBody>(response.body));
  client.keep = client.keep && !response.close && !ends_by_close;
  return response;
}

}  // namespace voxeld::http
