// Content ids: the hash of bytes, and the comparison of a download with the id that the daemon
// sends as its ETag.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace voxeld::client {

// SHA-256 of bytes that come in pieces.
class ContentHash {
 public:
  ContentHash();
  ~ContentHash();
  void add(std::span<const std::byte> piece);
  std::string finish();  // 64 hex digits; call it once

 private:
  struct Digest;
  std::unique_ptr<Digest> digest_;
};

class ContentCheck {
 public:
  // `etag`: "sha256-" and 64 hex digits, in quotes. Nothing is checked for any other.
  explicit ContentCheck(std::string_view etag);
  ~ContentCheck();

  void add(std::span<const std::byte> piece);
  // Call it after the last piece. Throws Error "content-mismatch", naming `what` was downloaded.
  void finish(std::string_view what);
  // The id that the daemon sent: "sha256-" and 64 hex digits; empty: none.
  std::string id() const { return expected_.empty() ? "" : "sha256-" + expected_; }

 private:
  std::string expected_;  // 64 hex digits; empty: nothing is checked
  std::optional<ContentHash> hash_;
};

}  // namespace voxeld::client
