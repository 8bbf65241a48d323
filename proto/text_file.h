// The text of a mesh or material file, in the one form that all its readers take: loaders, and the
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

// ASCII, or UTF-8 and other supersets of it, in lines that end with LF or CRLF. UTF-16 with its
// byte order mark becomes UTF-8, other marks are dropped, a CR alone becomes LF, and the NUL and ^Z
// that some programs write behind the last line are left out. `storage` holds the text where it
// differs from that of `bytes`; both must outlive it.
std::string_view plain_text(std::span<const uint8_t> bytes, std::string& storage);

}  // namespace voxeld
