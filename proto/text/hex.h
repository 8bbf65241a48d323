// Bytes as hexadecimal digits in small letters.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace voxeld {

inline constexpr std::string_view kHexDigits = "0123456789abcdef";

// Appends the two digits of a byte.
inline void append_hex(std::string& text, uint8_t byte) {
  text += kHexDigits[byte >> 4];
  text += kHexDigits[byte & 15];
}

inline std::string hex_text(std::span<const uint8_t> bytes) {
  std::string text;
  text.reserve(2 * bytes.size());
  for (const uint8_t byte : bytes) append_hex(text, byte);
  return text;
}

// Whether the text is of such digits alone; an empty one is.
inline bool is_hex(std::string_view text) {
  return text.find_first_not_of(kHexDigits) == std::string_view::npos;
}

}  // namespace voxeld
