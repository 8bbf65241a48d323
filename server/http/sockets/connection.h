// One client connection: its socket and the bytes that were received ahead of need.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "server/base/disk/file.h"

namespace voxeld::http {

// Not thread-safe: one thread of the server at a time owns it. The socket is non-blocking, and no
// call waits.
class Connection {
 public:
  Connection(UniqueFd fd, std::string peer) : fd_(std::move(fd)), peer_(std::move(peer)) {}

  int fd() const { return fd_.get(); }
  const std::string& peer() const { return peer_; }
  // Bytes that were received and not yet consumed.
  std::string& buffer() { return buffer_; }
  // Frees the memory of an empty buffer that grew large.
  void shrink_buffer();

  enum class ReadState { kData, kNothing, kClosed };
  // Appends bytes that have arrived to buffer().
  ReadState receive_available(size_t bytes_max);
  // Sends the bytes that the socket takes now and returns their number, which may be 0. Errors set
  // broken().
  int64_t send_some(std::string_view bytes);
  int64_t send_file_some(int file, int64_t offset, int64_t bytes);
  // For each thread that sends files: sendfile() to a client that has left raises SIGPIPE, and has
  // no flag against that.
  static void block_sigpipe();
  // Whether the peer closed its side, or this one was shut down, even if bytes are left unread.
  bool peer_closed() const;
  bool broken() const { return broken_; }

 private:
  UniqueFd fd_;
  std::string peer_;
  std::string buffer_;
  bool broken_ = false;
};

}  // namespace voxeld::http
