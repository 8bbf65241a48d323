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
  Status send(std::string_view payload);
  // Error gone with detail "connection closed" at a clean end between frames.
  Result<std::string> receive();
  int fd() const { return fd_.get(); }

 private:
  UniqueFd fd_;
  uint32_t frame_bytes_max_;
};

}  // namespace voxeld
