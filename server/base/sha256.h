// Content hashes, of bytes and of files that need not fit into memory, and HMAC-SHA256 (RFC 2104).
// Ids on the wire are "sha256-" and 64 lower-case hex digits.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "proto/result.h"

namespace voxeld {

// Incremental SHA-256 (OpenSSL's EVP). One writer; not thread-safe.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;

  void update(std::span<const uint8_t> bytes);
  void update(std::string_view text);
  // Returns "sha256-<64 hex>". Call it once.
  std::string finish_id();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

std::string sha256_id(std::span<const uint8_t> bytes);
std::string sha256_id(std::string_view text);
// Whether the text is exactly "sha256-" and 64 lower-case hex digits, and thus safe as a file name.
bool is_sha256_id(std::string_view id);

// Returns "sha256-<64 hex>". Errors: those of MappedFile::open().
Result<std::string> sha256_file_id(const std::filesystem::path& path);

// The HMAC as 64 lower-case hex digits.
std::string hmac_sha256(std::string_view key, std::string_view text);

}  // namespace voxeld
