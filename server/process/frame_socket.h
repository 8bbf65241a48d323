// Unix stream sockets that carry frames: u32 little-endian byte count, then that many bytes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "server/base/disk/file.h"

namespace voxeld {

// Listens on a Unix socket that only this user can reach. Replaces an old socket file.
Result<UniqueFd> listen_unix(const std::filesystem::path& path);
Result<UniqueFd> connect_unix(const std::filesystem::path& path);

// One blocking connection. Not thread-safe: use one thread, or a lock.
class FrameSocket {
 public:
  FrameSocket(UniqueFd fd, uint32_t frame_bytes_max)
      : fd_(std::move(fd)), send_bytes_max_(frame_bytes_max), receive_bytes_max_(frame_bytes_max) {}
  // Limits an untrusted peer. Its frames have at most this many bytes. Once a frame has begun, it
  // must be received, or read by the peer, within `frame_seconds_max`.
  void distrust(uint32_t receive_bytes_max, double frame_seconds_max) {
    receive_bytes_max_ = receive_bytes_max;
    frame_seconds_max_ = frame_seconds_max;
  }
  // Errors: gone if the peer has closed, internal if the payload is too long, bad-request if the
  // peer does not read it in time.
  Status send(std::string_view payload);
  // Errors: gone with detail "connection closed" at a clean end between frames, deadline-exceeded
  // after the receive timeout, bad-request for a frame that is too long or does not arrive in time.
  Result<std::string> receive();
  // How long receive() waits for a frame to begin; 0: without a limit.
  Status set_receive_timeout(double seconds);
  // Whether the peer has closed its end and nothing is left to read. Does not block.
  bool peer_closed() const;
  // Ends both directions, so a blocked receive() in another thread returns. Any thread may call it
  // while the object lives.
  void shutdown();
  int fd() const { return fd_.get(); }

 private:
  UniqueFd fd_;
  uint32_t send_bytes_max_, receive_bytes_max_;
  double frame_seconds_max_ = 0;  // 0: no limit
};

}  // namespace voxeld
