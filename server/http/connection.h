// One client connection: its socket, what was read ahead of need, and bounded waits.
#pragma once

#include <chrono>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "server/base/file.h"

namespace voxeld::http {

using Clock = std::chrono::steady_clock;

// Not thread-safe: the front's thread owns it while it is idle, one request thread while a request
// is answered. The socket is non-blocking.
class Connection {
 public:
  Connection(UniqueFd fd, std::string peer) : fd_(std::move(fd)), peer_(std::move(peer)) {}

  int fd() const { return fd_.get(); }
  const std::string& peer() const { return peer_; }
  // Bytes that were received and not yet consumed.
  std::string& buffer() { return buffer_; }

  enum class ReadState { kData, kNothing, kClosed };
  // Appends what is there to buffer(), without waiting.
  ReadState receive_available(size_t bytes_max);
  // Waits until there is data; false at the deadline, at the end of the stream or on an error.
  bool receive_more(Clock::time_point deadline, size_t bytes_max);
  // False when the client went away or took nothing for `kWriteStallSeconds`.
  bool send(std::string_view bytes);
  // What the socket takes now, without waiting: bytes, 0 where it takes none; broken() on errors.
  int64_t send_some(std::string_view bytes);
  int64_t send_file_some(int file, int64_t offset, int64_t bytes);
  // Whether the peer closed its side, or this one was cut, whatever is left unread.
  bool peer_closed() const;
  bool broken() const { return broken_; }

 private:
  bool wait(short events, Clock::time_point deadline) const;

  UniqueFd fd_;
  std::string peer_;
  std::string buffer_;
  bool broken_ = false;
};

// A client that takes nothing for so long is cut off.
inline constexpr int kWriteStallSeconds = 30;

}  // namespace voxeld::http
