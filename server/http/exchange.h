// Writing answers: heads, files, ranges, event streams.
#pragma once

#include <string>
#include <string_view>

#include "server/http/connection.h"
#include "server/http/message.h"

namespace voxeld::http {

// Where a stream's handler writes; every write goes out at once.
class EventSink {
 public:
  explicit EventSink(Connection& connection) : connection_(connection) {}
  // False when the client is gone.
  bool write(std::string_view text) { return connection_.send(text); }
  bool client_gone() const { return connection_.peer_closed(); }

 private:
  Connection& connection_;
};

// Sends the answer; `keep` says whether the connection will serve another request. A HEAD request
// gets the same head without a body. Returns the bytes of the body that were sent.
int64_t send_response(Connection& connection, const Head& head, Response& response, bool keep);

// Turns a whole 200 answer into 304, 206 or 416 by the request's If-None-Match, Range and If-Range
// (RFC 9110). One range only; a list of ranges is answered with the whole. `etag` with its quotes.
Result<Response> file_response(const Head& head, const FileBody& file, std::string_view etag);

std::string_view reason_phrase(int status);

}  // namespace voxeld::http
