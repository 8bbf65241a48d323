#include "server/base/random.h"

#include <sys/random.h>

#include <vector>

#include "proto/hex.h"
#include "server/base/check.h"

namespace voxeld {

void fill_random(std::span<uint8_t> bytes) {
  // At most 256 bytes at a time are never interrupted (getrandom(2)).
  VOXELD_CHECK(bytes.size() <= 256, "random bytes at a time");
  VOXELD_CHECK(::getrandom(bytes.data(), bytes.size(), 0) == std::ssize(bytes), "getrandom");
}

std::string random_hex(size_t digits) {
  std::vector<uint8_t> bytes(digits / 2);
  fill_random(bytes);
  return hex_text(bytes);
}

}  // namespace voxeld
