// Requests as handlers see them, and what handlers make of them: responses, bodies to receive,
// waits.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "proto/options/options.h"
#include "proto/result.h"
#include "server/base/disk/file.h"
#include "server/base/waker.h"
#include "server/http/message/authority.h"
#include "server/http/message/content_coding.h"
#include "server/http/message/trace_context.h"
#include "server/jobs/model/caller.h"

namespace voxeld::http {

struct LessNoCase {
  using is_transparent = void;
  bool operator()(std::string_view a, std::string_view b) const;
};
// Names compare without case. A header that stands twice is joined by ", ".
using Headers = std::map<std::string, std::string, LessNoCase>;

// The validated head of a request.
struct Head {
  std::string method;   // upper case
  std::string target;   // as sent
  std::string path;     // percent-decoded, begins with /; "%2f" stays encoded
  OptionPairs query;    // decoded, in order
  int minor = 1;        // HTTP/1.minor
  Authority authority;  // of the target in absolute form, else of Host
  Headers headers;
  std::optional<int64_t> content_length;
  bool chunked = false;
  ContentCoding coding = ContentCoding::kNone;  // of the body

  std::string_view header(std::string_view name) const;
  // The media type of Content-Type, without parameters, in small letters; empty without the header.
  std::string media_type() const;
  bool has_body() const { return chunked || content_length.value_or(0) > 0; }
  bool keep_alive() const;
};

// Request rate of a limited tenant.
struct RateState {
  bool admitted = true;
  int64_t burst = 0, window_s = 0;  // at most `burst` at a time, restored within window_s
  int64_t left = 0, reset_s = 0;    // requests left; seconds until all are restored
  int64_t retry_s = 0;              // until one is restored
};

using Clock = std::chrono::steady_clock;

// One request. It lives until its response has been sent.
struct Request {
  Head head;
  std::string route;                         // path pattern of the matching route, for metrics
  std::vector<std::string> path_parameters;  // what {…} of the route matched, in order
  std::string request_id;
  TraceContext trace;  // the span of this request
  // Set by access.h on admission; nobody() before.
  Caller caller = Caller::nobody();
  std::string key_id;             // API key of the request; empty if none is needed
  std::optional<RateState> rate;  // set if the tenant's requests are limited
  bool is_negotiated = false;     // Accept has chosen among formats
  int64_t body_bytes_max = 0;     // of the route
  // Resumes this request's Wait or PieceBody from any thread.
  std::shared_ptr<Waker> waker;

  // First value of a query parameter.
  std::optional<std::string> query(std::string_view name) const;
};

// Memory of one body piece. A client that does not read costs one piece.
inline constexpr int64_t kPieceBytesMax = int64_t{64} << 10;
// A text body up to here is sent as it is; a larger one is made in pieces, within MemoryBudget.
inline constexpr int64_t kTextBytesMax = int64_t{16} << 10;

// A response body that is a file, or a part of one.
struct FileBody {
  std::filesystem::path path;
  int64_t offset = 0;
  int64_t bytes = 0;
};

// One piece of a PieceBody.
struct Piece {
  std::string text;
  bool is_last = false;
  // Set if there is nothing to send now: the next piece is asked for when the request's waker is
  // called, or at this time. `text` is empty then.
  std::optional<Clock::time_point> wait_until = std::nullopt;
};

// A response body that is generated while it is sent: the next piece when the socket has taken
// those before it. A body of one piece has a Content-Length, of several Transfer-Encoding: chunked.
// If the first piece fails, its error is the response; a later failure cuts the connection.
struct PieceBody {
  std::function<Result<Piece>()> next;
  // Bytes that a piece needs while it is generated and until the socket has taken it.
  int64_t piece_bytes_max = kPieceBytesMax;
  // The file that the pieces are read from; its client keeps it like that of a FileBody.
  std::shared_ptr<const UniqueFd> file = nullptr;
};

struct Response {
  int status = 200;
  Headers headers;
  std::variant<std::string, FileBody, PieceBody> body;
  bool close = false;  // end the connection after it

  static Response json(int status, std::string text);
  static Response text(int status, std::string text);
  // application/problem+json with the status of the error's code.
  static Response problem(const Error& error, std::string_view instance,
                          std::string_view trace_id = "");
};

struct Reply;

// Receives the body of a request piece by piece, as it arrives. One thread at a time calls it.
class BodySink {
 public:
  virtual ~BodySink() = default;
  // Takes the next decoded bytes. An error becomes the response; the rest is not read.
  virtual Status take(std::span<const uint8_t> piece) = 0;
  // Called once, after the last piece.
  virtual Reply finish(Request& request) = 0;
};

// Asks for the request's body, given to `sink` without being held in memory. Errors of reading
// become the response: payload-too-large over `bytes_max` (compressed or inflated; at once if
// Content-Length says so), length-required if the request has neither length nor chunks,
// bad-request for broken chunks and codings and for bodies that end early, deadline-exceeded for
// slow ones.
struct StreamedBody {
  int64_t bytes_max = 0;
  std::unique_ptr<BodySink> sink;
};

// Asks for the request's body as one text, held in memory within MemoryBudget. Errors: those of
// StreamedBody.
struct TextBody {
  int64_t bytes_max = 0;
  std::function<Reply(Request&, std::string)> then;
};

// A response that is not ready yet. It holds no thread: the server calls look() when the wait
// begins, after Waker::wake() and at until(). Destroyed when it has given its response.
class Wait {
 public:
  virtual ~Wait() = default;
  // The response, or nullopt while there is none. One thread at a time calls it.
  virtual std::optional<Response> look(Request& request) = 0;
  // When look() is called without a wake; read after each look().
  virtual Clock::time_point until() const = 0;
  // The client has closed its side; look() is not called again.
  virtual void abandon(Request&) {}
};

// The result of a handler.
struct Reply {
  std::variant<Response, TextBody, StreamedBody, std::unique_ptr<Wait>> next;

  Reply(Response response) : next(std::move(response)) {}
  Reply(TextBody body) : next(std::move(body)) {}
  Reply(StreamedBody body) : next(std::move(body)) {}
  Reply(std::unique_ptr<Wait> wait) : next(std::move(wait)) {}
};

// Adds a header's name to Vary, once: a cache reuses the response only for equal values of it.
void add_vary(Response& response, std::string_view header);

// "inline" with the name of a file (RFC 6266): a quoted string, in which bytes that are not ASCII
// are '_'; where there are such, and the name is UTF-8, also in full as filename* (RFC 8187).
std::string content_disposition(std::string_view filename);

// Text that a client may safely receive in a header: no control characters.
std::string header_safe(std::string_view text);

}  // namespace voxeld::http
