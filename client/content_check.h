// Compares a download with its content id, which the daemon sends as its ETag.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace voxeld::client {

class ContentCheck {
 public:
  // `etag`: "sha256-" and 64 hex digits, in quotes. Nothing is checked for any other.
  explicit ContentCheck(std::string_view etag);
  ~ContentCheck();

  void add(std::span<const std::byte> piece);
  // Call it after the last piece. Throws Error "content-mismatch", naming `what` was downloaded.
  void finish(std::string_view what);

 private:
  struct Digest;
  std::string expected_;  // 64 hex digits; empty: nothing is checked
  std::unique_ptr<Digest> digest_;
};

}  // namespace voxeld::client
