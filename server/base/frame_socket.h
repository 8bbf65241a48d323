// Unix stream sockets that carry frames: u32 little-endian byte count, then that many bytes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "server/base/file.h"

namespace voxeld {

// Listens on a Unix socket that only this user may reach; an old socket file is replaced.
Result<UniqueFd> listen_unix(const std::filesystem::path& path);
Result<UniqueFd> connect_unix(const std::filesystem::path& path);

// One blocking connection. Not thread-safe: one thread, or callers that hold a lock.
class FrameSocket {
 public:
  FrameSocket(UniqueFd fd, uint32_t frame_bytes_max)
      : fd_(std::move(fd)), frame_bytes_max_(frame_bytes_max) {}
  // Errors: gone where the peer has closed, internal for a payload that is too long.
  Status send(std::string_view payload);
  // Errors: gone with detail "connection closed" at a clean end between frames, deadline-exceeded
  // after the receive timeout.
  Result<std::string> receive();
  // How long receive() waits for each part of a frame; 0: for ever.
  Status set_receive_timeout(double seconds);
  // True once the peer has closed its end and nothing is left to read. Does not block.
  bool peer_closed() const;
  // Ends both directions: a receive() that blocks in another thread returns. Safe to call from any
  // thread while the object lives.
  void shutdown();
  int fd() const { return fd_.get(); }

 private:
  UniqueFd fd_;
  uint32_t frame_bytes_max_;
};

}  // namespace voxeld
