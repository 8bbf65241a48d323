#include "server/http/output.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <exception>
#include <optional>
#include <utility>

#include "server/base/disk/file.h"
#include "server/base/guard.h"
#include "server/base/log.h"

namespace voxeld::http {
namespace {

// Files up to here go out with their head, in one write.
constexpr int64_t kInlineBytesMax = int64_t{64} << 10;
// Reserved for a head and a small body; larger ones grow.
constexpr size_t kUsualBytes = 2048;

}  // namespace

std::string_view reason_phrase(int status) {
  switch (status) {
    case 200:
      return "OK";
    case 201:
      return "Created";
    case 202:
      return "Accepted";
    case 204:
      return "No Content";
    case 206:
      return "Partial Content";
    case 304:
      return "Not Modified";
    case 400:
      return "Bad Request";
    case 401:
      return "Unauthorized";
    case 403:
      return "Forbidden";
    case 404:
      return "Not Found";
    case 405:
      return "Method Not Allowed";
    case 406:
      return "Not Acceptable";
    case 409:
      return "Conflict";
    case 410:
      return "Gone";
    case 411:
      return "Length Required";
    case 413:
      return "Content Too Large";
    case 415:
      return "Unsupported Media Type";
    case 416:
      return "Range Not Satisfiable";
    case 422:
      return "Unprocessable Content";
    case 429:
      return "Too Many Requests";
    case 500:
      return "Internal Server Error";
    case 503:
      return "Service Unavailable";
    case 504:
      return "Gateway Timeout";
    case 507:
      return "Insufficient Storage";
    default:
      return "Status";
  }
}

std::string http_date(std::time_t seconds) {
  constexpr std::array kDays = {"Sun", "Mon", "Tue", "Wed", "Thu", "Fri", "Sat"};
  constexpr std::array kMonths = {"Jan", "Feb", "Mar", "Apr", "May", "Jun",
                                  "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"};
  std::tm utc{};
  ::gmtime_r(&seconds, &utc);
  std::array<char, 40> text{};  // strftime() would use the names of the locale
  std::snprintf(text.data(), text.size(), "%s, %02d %s %04d %02d:%02d:%02d GMT",
                kDays.at(static_cast<size_t>(utc.tm_wday)), utc.tm_mday,
                kMonths.at(static_cast<size_t>(utc.tm_mon)), utc.tm_year + 1900, utc.tm_hour,
                utc.tm_min, utc.tm_sec);
  return text.data();
}

Output::Output(Context context, Response response, MemoryBudget& budget, const std::string& tenant,
               void* owner, HeldFiles* held_files)
    : context_(std::move(context)), status_(response.status), share_(budget, tenant, owner) {
  if (auto* pieces = std::get_if<PieceBody>(&response.body)) {
    pieces_ = std::move(*pieces);
    has_pieces_ = true;
    const bool reads_file = pieces_.file != nullptr && context_.method != "HEAD";
    if (reads_file && held_files != nullptr) held_ = held_files->add(tenant, pieces_.file->get());
    response_ = std::move(response);
  } else {
    write_whole(response);
    if (const FileBody* file = file_of(response)) add_file(*file, held_files, tenant);
  }
}

// `bytes` of the body; nullopt: not known, or there is none.
void Output::write_head(const Response& response, std::optional<int64_t> bytes) {
  text_.reserve(kUsualBytes);
  text_ += "HTTP/1.1 " + std::to_string(response.status) + " ";
  text_ += reason_phrase(response.status);
  text_ += "\r\n";
  text_ += "Date: " + http_date(std::time(nullptr)) + "\r\n";
  for (const auto& [name, value] : response.headers) {
    text_ += name;
    text_ += ": ";
    text_ += header_safe(value);
    text_ += "\r\n";
  }
  if (bytes) text_ += "Content-Length: " + std::to_string(*bytes) + "\r\n";
  if (is_chunked_) text_ += "Transfer-Encoding: chunked\r\n";
  text_ += context_.keep ? "Connection: keep-alive\r\n\r\n" : "Connection: close\r\n\r\n";
  head_bytes_ = static_cast<int64_t>(text_.size());
}

void Output::write_whole(const Response& response) {
  const auto* text = std::get_if<std::string>(&response.body);
  const auto* file = std::get_if<FileBody>(&response.body);
  const bool bodiless = response.status == 204 || response.status == 304;
  std::optional<int64_t> bytes;
  if (!bodiless && file != nullptr) bytes = file->bytes;
  if (!bodiless && text != nullptr) bytes = static_cast<int64_t>(text->size());
  write_head(response, bytes);
  if (context_.method == "HEAD" || bodiless) return;
  if (text != nullptr) text_ += *text;  // one segment for small responses
}

// The file that is sent behind the head; null: there is none.
const FileBody* Output::file_of(const Response& response) const {
  const auto* file = std::get_if<FileBody>(&response.body);
  const bool bodiless =
      context_.method == "HEAD" || response.status == 204 || response.status == 304;
  return bodiless || file == nullptr || file->bytes == 0 ? nullptr : file;
}

Result<Piece> Output::make_piece() {
  try {
    return pieces_.next();
  } catch (const std::exception& failure) {  // no memory
    return exception_error(failure);
  }
}

Output::State Output::next_piece() {
  std::string().swap(text_);  // an assignment keeps its memory, which nobody would count
  text_at_ = 0;
  if (!share_.reserve(pieces_.piece_bytes_max)) return State::kHeld;
  Result<Piece> piece = make_piece();
  const bool is_first = head_bytes_ == 0;
  if (piece.ok() && piece->wait_until) {
    wait_until_ = *piece->wait_until;
    if (is_first) write_first(/*is_last=*/false, 0);
    is_waiting_ = context_.method != "HEAD";
    has_pieces_ = is_waiting_;
    share_.set(static_cast<int64_t>(text_.size()));
    return State::kDone;
  }
  if (!piece) {
    has_pieces_ = false;
    log::error("a piece of a response failed",
               {{"id", context_.request_id}, {"error", piece.error().message()}});
    if (!is_first) return State::kBroken;
    Response problem = Response::problem(piece.error(), context_.path, context_.trace_id);
    response_.headers.erase("ETag");
    problem.headers.merge(response_.headers);
    status_ = problem.status;
    write_whole(problem);
    return State::kDone;
  }
  std::string& body = piece->text;
  if (is_first) write_first(piece->is_last, std::ssize(body));
  const bool is_head = context_.method == "HEAD";
  if (!is_head && is_chunked_ && !body.empty()) {
    std::array<char, 24> size{};
    std::snprintf(size.data(), size.size(), "%zx\r\n", body.size());
    text_ += size.data();
  }
  if (!is_head) text_ += body;
  if (!is_head && is_chunked_ && !body.empty()) text_ += "\r\n";
  if (!is_head && is_chunked_ && piece->is_last) text_ += "0\r\n\r\n";
  if (is_head || piece->is_last) {
    has_pieces_ = false;
    held_ = {};
    pieces_ = {};  // with what it holds
  }
  share_.set(static_cast<int64_t>(text_.size()));
  return State::kDone;
}

// The head before a first piece of `bytes`.
void Output::write_first(bool is_last, int64_t bytes) {
  is_chunked_ = !is_last && context_.minor >= 1;
  write_head(response_, is_last ? std::optional(bytes) : std::nullopt);
  response_ = {};
}

void Output::add_file(const FileBody& body, HeldFiles* held_files, const std::string& tenant) {
  file_ = UniqueFd(::open(body.path.c_str(), O_RDONLY | O_CLOEXEC));
  file_at_ = body.offset;
  file_left_ = body.bytes;
  // The length was promised: that a blob vanished can only be told by breaking the connection,
  // which sending from no file does.
  if (!file_.valid()) return;
  if (body.bytes > kInlineBytesMax) {
    if (held_files != nullptr) held_ = held_files->add(tenant, file_.get());
    return;
  }
  std::string bytes(static_cast<size_t>(body.bytes), '\0');
  if (::pread(file_.get(), bytes.data(), bytes.size(), body.offset) != body.bytes) return;
  text_ += bytes;
  file_left_ = 0;
  file_.reset();
}

Output::State Output::advance(Connection& connection) {
  const int64_t turn_ends = sent_ + kTurnBytes;
  while (!connection.broken()) {
    int64_t sent = 0;
    if (text_at_ < text_.size()) {
      sent = connection.send_some(
          std::string_view(text_).substr(text_at_, static_cast<size_t>(turn_ends - sent_)));
      text_at_ += static_cast<size_t>(sent);
    } else if (std::exchange(is_waiting_, false)) {
      return State::kWaiting;
    } else if (has_pieces_) {
      const State state = next_piece();
      if (state != State::kDone) return state;
      continue;
    } else if (file_left_ > 0) {
      sent =
          connection.send_file_some(file_.get(), file_at_, std::min(file_left_, turn_ends - sent_));
      file_at_ += sent;
      file_left_ -= sent;
    } else {
      return State::kDone;
    }
    sent_ += sent;
    if (connection.broken()) break;
    if (sent == 0 || sent_ >= turn_ends) return blocked();
  }
  return State::kBroken;
}

// Bytes that the socket did not take count against the budget, whatever the kind of body.
Output::State Output::blocked() {
  if (text_at_ == text_.size()) std::string().swap(text_);
  if (text_.empty()) text_at_ = 0;
  share_.set(static_cast<int64_t>(text_.size()));
  return State::kBlocked;
}

}  // namespace voxeld::http
