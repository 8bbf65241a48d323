#include "client/content_check.h"

#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <new>

#include "client/include/voxeld/client.h"
#include "proto/text/hex.h"

namespace voxeld::client {
namespace {

constexpr std::string_view kPrefix = "\"sha256-";
constexpr size_t kDigestDigits = 64;

// The digest in an ETag; empty if it is not a content id.
std::string digest_of(std::string_view etag) {
  if (etag.size() != kPrefix.size() + kDigestDigits + 1) return {};
  if (!etag.starts_with(kPrefix) || !etag.ends_with('"')) return {};
  const std::string_view hex = etag.substr(kPrefix.size(), kDigestDigits);
  if (!is_hex(hex)) return {};
  return std::string(hex);
}

}  // namespace

struct ContentHash::Digest {
  EVP_MD_CTX* context = EVP_MD_CTX_new();
  Digest() {
    if (context == nullptr) throw std::bad_alloc();
    EVP_DigestInit_ex(context, EVP_sha256(), nullptr);
  }
  Digest(const Digest&) = delete;
  Digest& operator=(const Digest&) = delete;
  ~Digest() { EVP_MD_CTX_free(context); }
};

ContentHash::ContentHash() : digest_(std::make_unique<Digest>()) {}

ContentHash::~ContentHash() = default;

void ContentHash::add(std::span<const std::byte> piece) {
  EVP_DigestUpdate(digest_->context, piece.data(), piece.size());
}

std::string ContentHash::finish() {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  EVP_DigestFinal_ex(digest_->context, digest.data(), &size);
  return hex_text(std::span(digest).first(size));
}

ContentCheck::ContentCheck(std::string_view etag) : expected_(digest_of(etag)) {
  if (!expected_.empty()) hash_.emplace();
}

ContentCheck::~ContentCheck() = default;

void ContentCheck::add(std::span<const std::byte> piece) {
  if (hash_) hash_->add(piece);
}

void ContentCheck::finish(std::string_view what) {
  if (!hash_) return;
  const std::string got = hash_->finish();
  if (got == expected_) return;
  throw Error("content-mismatch", 0,
              std::string(what) + " was damaged on its way, or where it is stored",
              "sha256-" + expected_, "sha256-" + got);
}

}  // namespace voxeld::client
