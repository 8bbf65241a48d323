// The text of a mesh or material file in the one form that all readers take: the loaders, and the
// CLI, which looks for the names of other files.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace voxeld {

inline std::string_view as_text(std::span<const uint8_t> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

inline bool is_blank(char c) {
  return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f';
}

// Returns ASCII, or UTF-8 and other supersets of it, in lines that end with LF or CRLF. UTF-16 with
// a byte order mark becomes UTF-8, other marks are dropped, and a lone CR becomes LF. NUL and ^Z
// after the last line, which some programs write, are dropped. `storage` holds the text if it
// differs from `bytes`; both must outlive it.
std::string_view plain_text(std::span<const uint8_t> bytes, std::string& storage);

// The text without blanks and line ends at both sides.
std::string_view trimmed(std::string_view text);
// Equality of ASCII text without regard to case.
bool equals_ignoring_case(std::string_view a, std::string_view b);
// Whether it is UTF-8 without overlong forms and surrogates (RFC 3629).
bool is_utf8(std::string_view text);
// Appends the character with number `c`.
void append_utf8(uint32_t c, std::string& out);

}  // namespace voxeld
