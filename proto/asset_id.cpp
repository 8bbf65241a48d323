#include "proto/asset_id.h"

#include <algorithm>
#include <filesystem>

#include "proto/text/hex.h"

namespace voxeld {
namespace {

constexpr size_t kBlobIdBytes = 71;  // "sha256-" and 64 digits
// The extension of no format: the bytes alone decide how the file is read.
constexpr std::string_view kBytesAlone = ".bytes";

// Characters that stay unescaped. Ids appear in URLs, so the rest is escaped as ~XX.
bool is_plain(char c) {
  return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || c == '.' ||
         c == '_' || c == '-';
}

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (is_plain(c)) {
      out += c;
    } else {
      out += '~';
      append_hex(out, byte);
    }
  }
  return out;
}

int digit_of(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

// Undoes escaped(). Text that is not a valid escape stays as it is.
std::string unescaped(std::string_view text) {
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    const bool is_escape = text[i] == '~' && i + 2 < text.size() && digit_of(text[i + 1]) >= 0 &&
                           digit_of(text[i + 2]) >= 0;
    if (is_escape) {
      out += static_cast<char>(digit_of(text[i + 1]) * 16 + digit_of(text[i + 2]));
      i += 2;
    } else {
      out += text[i];
    }
  }
  return out;
}

}  // namespace

std::string reading_of(std::string_view filename) {
  const size_t member = filename.find('!');
  std::string reading = std::filesystem::path(filename.substr(0, member)).extension().string();
  std::transform(reading.begin(), reading.end(), reading.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  if (member != filename.npos) reading += filename.substr(member);
  return reading;
}

AssetId AssetId::parse(std::string_view id) {
  if (id.size() <= kBlobIdBytes || id[kBlobIdBytes] != '.') return {std::string(id), std::nullopt};
  return {std::string(id.substr(0, kBlobIdBytes)), unescaped(id.substr(kBlobIdBytes))};
}

std::string AssetId::text() const {
  if (!reading) return blob;
  const std::string suffix = escaped(*reading);
  // A name without an extension may still have a member: ".bytes!a.obj" is "bytes~21a.obj".
  return blob + (suffix.starts_with('.') ? "" : std::string(kBytesAlone)) + suffix;
}

std::string filename_read_as(std::string_view filename, std::string_view reading) {
  const std::string stem =
      std::filesystem::path(filename.substr(0, filename.find('!'))).stem().string();
  return (stem.empty() ? "asset" : stem) + std::string(reading);
}

}  // namespace voxeld
