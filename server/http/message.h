// A request as handlers see it, and the answer that they give.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "proto/options.h"
#include "proto/result.h"
#include "server/base/authority.h"
#include "server/base/trace_context.h"
#include "server/http/content_coding.h"
#include "server/jobs/caller.h"

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
  // Of Content-Type, without parameters, in small letters; empty where it is absent.
  std::string media_type() const;
  bool has_body() const { return chunked || content_length.value_or(0) > 0; }
  bool keep_alive() const;
};

// What is left to a tenant whose requests are limited.
struct RateState {
  bool admitted = true;
  int64_t burst = 0, window_s = 0;  // at most `burst` at a time, which takes this long to come back
  int64_t left = 0, reset_s = 0;    // until all of it is there again
  int64_t retry_s = 0;              // until there is one
};

class BodyReader;
class EventSink;

// What a handler works on; lives for one exchange.
struct Request {
  Head head;
  std::string route;                         // the pattern that it matched, for metrics
  std::vector<std::string> path_parameters;  // what {…} of the route matched, in order
  std::string request_id;
  TraceContext trace;  // the span of this request
  // Whose request it is, by access.h: before it was admitted, nobody's.
  Caller caller = Caller::nobody();
  std::string key_id;             // of the key that it came with; empty where none is needed
  std::optional<RateState> rate;  // where the tenant's requests are limited
  BodyReader* body = nullptr;
  // True when the client closed its side; cheap enough to poll.
  std::function<bool()> client_gone;
  bool is_negotiated = false;  // its Accept has chosen among formats

  // First value of a query parameter.
  std::optional<std::string> query(std::string_view name) const;
};

// Bytes of a body in memory that are made at once. A client that does not read costs one piece.
inline constexpr int64_t kPieceBytesMax = int64_t{64} << 10;
// A text body up to here is sent as it is; a larger one is made in pieces, within AnswerBudget.
inline constexpr int64_t kTextBytesMax = int64_t{16} << 10;

// The bytes of an answer: in memory, or (a part of) a file.
struct FileBody {
  std::filesystem::path path;
  int64_t offset = 0;
  int64_t bytes = 0;
};
// A body that is made while it is sent: the next piece when the socket has taken those before it.
// An answer of one piece has a Content-Length, of several Transfer-Encoding: chunked. Where the
// first piece fails, its error is the answer; a later failure cuts the connection.
struct Piece {
  std::string text;
  bool is_last = false;
};
struct PieceBody {
  std::function<Result<Piece>()> next;
  // What a piece takes while it is made and until the socket has it.
  int64_t piece_bytes_max = kPieceBytesMax;
};
// Writes a stream of unknown length (server-sent events); the connection closes at its end.
using StreamBody = std::function<void(EventSink&)>;

struct Response {
  int status = 200;
  Headers headers;
  std::variant<std::string, FileBody, PieceBody, StreamBody> body;
  bool close = false;  // end the connection after it

  static Response json(int status, std::string text);
  static Response text(int status, std::string text);
  // application/problem+json with the status of the error's code.
  static Response problem(const Error& error, std::string_view instance,
                          std::string_view trace_id = "");
};

// Adds a header's name to Vary, once: a cache keeps the answer for equal values of it alone.
void add_vary(Response& response, std::string_view header);

// "inline" with the name of a file (RFC 6266): a quoted string, in which bytes that are not ASCII
// are '_'; where there are such, and the name is UTF-8, also in full as filename* (RFC 8187).
std::string content_disposition(std::string_view filename);

// Text that a client may safely receive in a header: no control characters.
std::string header_safe(std::string_view text);

}  // namespace voxeld::http
