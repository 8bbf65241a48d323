// Writing answers: heads, texts, pieces, files, ranges, event streams.
#pragma once

#include <algorithm>
#include <cstdint>
#include <ctime>
#include <optional>
#include <string>
#include <string_view>

#include "server/base/file.h"
#include "server/http/answer_budget.h"
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

// An answer on its way: it goes on where it stopped, so that a client that reads slowly holds no
// thread.
class Output {
 public:
  // What an answer needs to know of its request.
  struct Context {
    std::string method = "GET", path;  // of the request
    int minor = 1;                     // HTTP/1.minor
    std::string request_id, trace_id;
    // Whether the connection will serve another request.
    bool keep = false;
  };
  // A HEAD request gets the same head without a body; of a stream this is the head alone. `tenant`
  // is whose budget the bytes are of; `owner` is what AnswerBudget::grant() hands back.
  Output(Context context, Response response, AnswerBudget& budget, std::string tenant, void* owner);

  enum class State {
    kDone,
    kBlocked,  // until the socket takes more
    kHeld,     // until AnswerBudget::grant() gives it the bytes of the next piece
    kBroken,
  };
  // Sends what the socket takes without waiting.
  State advance(Connection& connection);
  // Of the answer: that of the first piece's error, where it failed.
  int status() const { return status_; }
  // Of head and body.
  int64_t sent() const { return sent_; }
  int64_t body_sent() const { return std::max<int64_t>(0, sent_ - head_bytes_); }

 private:
  void write_head(const Response& response, std::optional<int64_t> bytes);
  void write_whole(const Response& response);
  void add_file(const FileBody& body);
  // Replaces the text, which is sent, by the next piece.
  State next_piece();
  Result<Piece> make_piece();
  State blocked();

  const Context context_;
  Response response_;  // of pieces, until the head is written
  int status_ = 0;
  PieceBody pieces_;
  bool has_pieces_ = false, is_chunked_ = false;
  AnswerShare share_;
  std::string text_;
  size_t text_at_ = 0;
  UniqueFd file_;
  int64_t file_at_ = 0, file_left_ = 0;
  int64_t head_bytes_ = 0, sent_ = 0;
};

// Turns a whole 200 answer into 304, 206 or 416 by the request's If-None-Match, Range and If-Range
// (RFC 9110). One range only; a list of ranges is answered with the whole. `etag` with its quotes.
Result<Response> file_response(const Head& head, const FileBody& file, std::string_view etag);

std::string_view reason_phrase(int status);

// "Sun, 06 Nov 1994 08:49:37 GMT" (RFC 9110 section 5.6.7).
std::string http_date(std::time_t seconds);

}  // namespace voxeld::http
