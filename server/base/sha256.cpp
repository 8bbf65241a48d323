#include "server/base/sha256.h"

#include <openssl/evp.h>
#include <openssl/hmac.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <new>
#include <span>

#include "proto/blob_id.h"
#include "proto/text/hex.h"
#include "server/base/cancel_point.h"
#include "server/base/check.h"
#include "server/base/disk/file.h"
#include "server/base/disk/mapped_pages.h"

namespace voxeld {

namespace {
constexpr std::string_view kPrefix = "sha256-";
// Fetched before main(): OpenSSL 3.0 crashes if memory runs out during its initialization.
const EVP_MD* const kAlgorithm = EVP_MD_fetch(nullptr, "SHA256", nullptr);
}  // namespace

struct Sha256::Impl {
  EVP_MD_CTX* context = EVP_MD_CTX_new();
  ~Impl() { EVP_MD_CTX_free(context); }
};

Sha256::Sha256() : impl_(std::make_unique<Impl>()) {
  // Fails only if memory runs out.
  if (impl_->context == nullptr || EVP_DigestInit_ex(impl_->context, kAlgorithm, nullptr) != 1) {
    throw std::bad_alloc();
  }
}
Sha256::~Sha256() = default;
Sha256::Sha256(Sha256&&) noexcept = default;
Sha256& Sha256::operator=(Sha256&&) noexcept = default;

void Sha256::update(std::span<const uint8_t> bytes) {
  VOXELD_CHECK(EVP_DigestUpdate(impl_->context, bytes.data(), bytes.size()) == 1, "sha256 update");
}

void Sha256::update(std::string_view text) {
  update(std::span(reinterpret_cast<const uint8_t*>(text.data()), text.size()));
}

std::string Sha256::finish_id() {
  std::array<uint8_t, 32> digest{};
  VOXELD_CHECK(EVP_DigestFinal_ex(impl_->context, digest.data(), nullptr) == 1, "sha256 final");
  return std::string(kPrefix) + hex_text(digest);
}

std::string sha256_id(std::span<const uint8_t> bytes) {
  Sha256 hash;
  hash.update(bytes);
  return hash.finish_id();
}

std::string sha256_id(std::string_view text) {
  Sha256 hash;
  hash.update(text);
  return hash.finish_id();
}

bool is_sha256_id(std::string_view id) {
  return is_blob_id(id);
}

Result<std::string> sha256_file_id(const std::filesystem::path& path) {
  constexpr size_t kPieceBytes = size_t{8} << 20;
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(path));
  Sha256 hash;
  for (std::span<const uint8_t> rest = file.bytes(); !rest.empty();) {
    const auto piece = rest.first(std::min(rest.size(), kPieceBytes));
    cancel_point();
    hash.update(piece);
    drop_mapped_pages(piece);
    rest = rest.subspan(piece.size());
  }
  return hash.finish_id();
}

std::string hmac_sha256(std::string_view key, std::string_view text) {
  std::array<uint8_t, 32> digest{};
  unsigned int bytes = 0;
  VOXELD_CHECK(HMAC(EVP_sha256(), key.data(), static_cast<int>(key.size()),
                    reinterpret_cast<const uint8_t*>(text.data()), text.size(), digest.data(),
                    &bytes) != nullptr &&
                   bytes == digest.size(),
               "hmac");
  return hex_text(digest);
}

}  // namespace voxeld
