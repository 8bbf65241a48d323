#include "server/base/hmac.h"

#include <openssl/evp.h>
#include <openssl/hmac.h>

#include <array>
#include <cstdint>

#include "proto/hex.h"
#include "server/base/check.h"

namespace voxeld {

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
