#include "server/base/random.h"

#include <sys/random.h>

#include <array>
#include <random>
#include <vector>

#include "proto/text/hex.h"
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

std::string id_hex(size_t digits) {
  thread_local std::mt19937_64 numbers = [] {
    std::array<uint8_t, 64> bytes{};
    fill_random(bytes);
    std::seed_seq seeds(bytes.begin(), bytes.end());
    return std::mt19937_64(seeds);
  }();
  std::string text(digits, '0');
  uint64_t number = 0;
  for (size_t i = 0; i < digits; ++i) {
    if (i % 16 == 0) number = numbers();
    text[i] = "0123456789abcdef"[number >> (4 * (i % 16)) & 15];
  }
  return text;
}

}  // namespace voxeld
