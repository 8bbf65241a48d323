#include "server/jobs/auth/api_key.h"

#include <time.h>

#include <algorithm>
#include <array>
#include <span>

#include "proto/text/client_texts.h"
#include "proto/text/number_text.h"
#include "server/base/check.h"
#include "server/base/random.h"
#include "server/base/sha256.h"

namespace voxeld {
namespace {

constexpr std::string_view kPrefix = "vxk_";
// RFC 4648 in small letters: no character that ends a word, none that a URL or a shell changes.
constexpr std::string_view kBase32 = "abcdefghijklmnopqrstuvwxyz234567";
constexpr size_t kIdBytes = 5, kIdDigits = 8;
constexpr size_t kSecretBytes = 32, kSecretDigits = 52;
constexpr int64_t kHourMs = int64_t{3600} * 1000;
constexpr int64_t kExpiryHoursMax = int64_t{100} * 366 * 24;

std::string base32(std::span<const uint8_t> bytes) {
  std::string text;
  uint32_t bits = 0;
  int count = 0;
  for (const uint8_t byte : bytes) {
    bits = bits << 8 | byte;
    for (count += 8; count >= 5; count -= 5) text += kBase32[bits >> (count - 5) & 31];
  }
  if (count > 0) text += kBase32[bits << (5 - count) & 31];
  return text;
}

template <size_t kBytes>
std::string random_base32() {
  std::array<uint8_t, kBytes> bytes{};
  fill_random(bytes);
  return base32(bytes);
}

bool is_base32(std::string_view text, size_t digits) {
  return text.size() == digits && text.find_first_not_of(kBase32) == std::string_view::npos;
}

Error expiry_error(std::string_view text) {
  return {ErrorCode::kInvalidOption, "expires",
          "a time from now (12h, 30d, 8w; at most 100 years) or a day to come (2030-12-31)",
          echoed(text)};
}

// Midnight (UTC) at the beginning of "2026-12-31"; negative where that is no day.
int64_t day_ms(std::string_view text) {
  if (text.size() != 10 || text[4] != '-' || text[7] != '-') return -1;
  const auto year = parse_digits<int>(text.substr(0, 4));
  const auto month = parse_digits<int>(text.substr(5, 2));
  const auto day = parse_digits<int>(text.substr(8, 2));
  if (!year || !month || !day) return -1;
  tm date{};
  date.tm_year = *year - 1900;
  date.tm_mon = *month - 1;
  date.tm_mday = *day;
  const time_t seconds = ::timegm(&date);
  // timegm() takes the 31st of April for the 1st of May.
  if (date.tm_mon != *month - 1 || date.tm_mday != *day) return -1;
  return static_cast<int64_t>(seconds) * 1000;
}

}  // namespace

std::string KeySecret::hash() const {
  return sha256_id(secret);
}

KeySecret make_key_secret() {
  return {random_base32<kIdBytes>(), random_base32<kSecretBytes>()};
}

bool is_key_id(std::string_view text) {
  return is_base32(text, kIdDigits);
}

PresentedKey split_key(std::string_view text) {
  if (!text.starts_with(kPrefix)) return {};
  text.remove_prefix(kPrefix.size());
  const size_t end = text.find('_');
  if (end == std::string_view::npos) return {};
  const PresentedKey key{text.substr(0, end), text.substr(end + 1)};
  if (!is_key_id(key.id) || !is_base32(key.secret, kSecretDigits)) return {};
  return key;
}

bool equal_in_constant_time(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  // Volatile: the compiler may not leave the loop early.
  volatile unsigned char difference = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    difference = static_cast<unsigned char>(difference | (a[i] ^ b[i]));
  }
  return difference == 0;
}

Status check_tenant_name(std::string_view name) {
  const auto is_plain = [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9'); };
  const bool good = !name.empty() && name.size() <= 64 && is_plain(name[0]) &&
                    std::ranges::all_of(name, [&](char c) {
                      return is_plain(c) || c == '.' || c == '_' || c == '-';
                    });
  if (good) return {};
  return Error{ErrorCode::kInvalidOption, "name of a tenant",
               "1 to 64 of a-z, 0-9, '.', '_', '-', beginning with a letter or digit",
               echoed(name)};
}

Result<int64_t> parse_expiry(std::string_view text, int64_t now_ms) {
  if (const int64_t day = day_ms(text); day >= 0) {
    if (day <= now_ms || day - now_ms > kExpiryHoursMax * kHourMs) return expiry_error(text);
    return day;
  }
  if (text.size() < 2) return expiry_error(text);
  const int64_t hours = text.back() == 'h'   ? 1
                        : text.back() == 'd' ? 24
                        : text.back() == 'w' ? int64_t{24} * 7
                                             : 0;
  if (hours == 0) return expiry_error(text);
  const auto count =
      parse_number<int64_t>(text.substr(0, text.size() - 1), 1, kExpiryHoursMax / hours);
  if (!count) return expiry_error(text);
  return now_ms + *count * hours * kHourMs;
}

}  // namespace voxeld
