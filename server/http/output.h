// Writes responses to sockets that take them at their own pace: heads, texts, pieces, files.
#pragma once

#include <algorithm>
#include <cstdint>
#include <ctime>
#include <optional>
#include <string>
#include <string_view>

#include "server/base/disk/file.h"
#include "server/http/memory_budget.h"
#include "server/http/message/message.h"
#include "server/http/sockets/connection.h"
#include "server/store/held_files.h"

namespace voxeld::http {

// One response on its way to its client. It resumes where it stopped, so that a client that reads
// slowly holds no thread. Not thread-safe.
class Output {
 public:
  // Facts of the request that shape its response.
  struct Context {
    std::string method = "GET", path;  // of the request
    int minor = 1;                     // HTTP/1.minor
    std::string request_id, trace_id;
    // Whether the connection will serve another request.
    bool keep = false;
  };
  // A HEAD request gets the same head without a body. The bytes count against the budget of
  // `tenant`; `owner` is what MemoryBudget::grant() hands back. `held_files` counts the file that
  // it sends; null: nobody does.
  Output(Context context, Response response, MemoryBudget& budget, const std::string& tenant,
         void* owner, HeldFiles* held_files);

  enum class State {
    kDone,
    kBlocked,  // until the socket takes more, which may be at once: other clients come first
    kHeld,     // until MemoryBudget::grant() gives it the bytes of the next piece
    kWaiting,  // for a wake or wait_until(): its PieceBody has nothing to send now
    kBroken,
  };
  // One turn of a client: others with requests or room in their sockets come between two turns, so
  // that hundreds of downloads that begin at once delay a request by milliseconds.
  static constexpr int64_t kTurnBytes = int64_t{256} << 10;
  // Sends a turn's bytes, or what the socket takes without waiting.
  State advance(Connection& connection);
  // HTTP status of the response; that of the first piece's error if that failed.
  int status() const { return status_; }
  Clock::time_point wait_until() const { return wait_until_; }
  // Bytes of head and body that the socket has taken.
  int64_t sent() const { return sent_; }
  // Whether it still sends a file; and one that was deleted, whose room its client keeps.
  bool sends_file() const { return file_left_ > 0 || reads_pieces(); }
  bool sends_deleted_file() const {
    return sends_file() && is_deleted(reads_pieces() ? pieces_.file->get() : file_.get());
  }
  int64_t body_sent() const { return std::max<int64_t>(0, sent_ - head_bytes_); }

 private:
  bool reads_pieces() const { return has_pieces_ && pieces_.file != nullptr; }
  void write_head(const Response& response, std::optional<int64_t> bytes);
  void write_whole(const Response& response);
  const FileBody* file_of(const Response& response) const;
  void write_first(bool is_last, int64_t bytes);
  void add_file(const FileBody& body, HeldFiles* held_files, const std::string& tenant);
  // Replaces the text, which has been sent, by the next piece.
  State next_piece();
  Result<Piece> make_piece();
  State blocked();

  const Context context_;
  Response response_;  // of a PieceBody, until its head is written
  int status_ = 0;
  PieceBody pieces_;
  bool has_pieces_ = false, is_chunked_ = false, is_waiting_ = false;
  Clock::time_point wait_until_{};
  MemoryShare share_;
  std::string text_;
  size_t text_at_ = 0;
  UniqueFd file_;
  HeldFiles::Hold held_;  // ends before the file is closed
  int64_t file_at_ = 0, file_left_ = 0;
  int64_t head_bytes_ = 0, sent_ = 0;
};

std::string_view reason_phrase(int status);

// "Sun, 06 Nov 1994 08:49:37 GMT" (RFC 9110 section 5.6.7).
std::string http_date(std::time_t seconds);

}  // namespace voxeld::http
