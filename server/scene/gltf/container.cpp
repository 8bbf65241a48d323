#include "server/scene/gltf/container.h"

#include <string>

#include "proto/file_names/file_names.h"
#include "server/base/pieces.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"

namespace voxeld::gltf {
namespace {

constexpr size_t kHeaderBytes = 12;
constexpr size_t kChunkHeaderBytes = 8;
constexpr uint32_t kMagic = 0x46546c67;      // "glTF"
constexpr uint32_t kJsonChunk = 0x4e4f534a;  // "JSON"
constexpr uint32_t kBinChunk = 0x004e4942;   // "BIN\0"

uint32_t u32_at(std::span<const uint8_t> bytes, size_t at) {
  return bytes[at] | uint32_t{bytes[at + 1]} << 8 | uint32_t{bytes[at + 2]} << 16 |
         uint32_t{bytes[at + 3]} << 24;
}

std::string bytes_text(size_t count) {
  return std::to_string(count) + " bytes";
}

Error malformed_at(std::string_view name, size_t byte, std::string_view what, std::string expected,
                   std::string got) {
  return malformed_mesh(name, "byte " + std::to_string(byte), what, std::move(expected),
                        std::move(got));
}

// The length that the header states, which may be less than the file's.
Result<size_t> checked_length(std::string_view name, std::span<const uint8_t> bytes) {
  if (bytes.size() < kHeaderBytes) {
    return malformed_at(name, bytes.size(), "the GLB header is cut off", bytes_text(kHeaderBytes),
                        bytes_text(bytes.size()));
  }
  const uint32_t version = u32_at(bytes, 4);
  if (version != 2) {
    return Error{ErrorCode::kUnsupportedFeature,
                 std::string(name) + ": version of the GLB container", "2",
                 std::to_string(version)};
  }
  const size_t length = u32_at(bytes, 8);
  if (length > bytes.size()) {
    return malformed_at(name, 8, "the file is shorter than its header says", bytes_text(length),
                        bytes_text(bytes.size()));
  }
  if (length < kHeaderBytes + kChunkHeaderBytes) {
    return malformed_at(name, 8, "no room for the JSON chunk",
                        "at least " + bytes_text(kHeaderBytes + kChunkHeaderBytes),
                        bytes_text(length));
  }
  return length;
}

// Value of one Base64 digit; -1 for other characters.
int base64_digit(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  if (c == '+' || c == '-') return 62;
  return c == '/' || c == '_' ? 63 : -1;
}

std::optional<std::vector<uint8_t>> decode_base64(std::string_view text) {
  while (!text.empty() && text.back() == '=') text.remove_suffix(1);
  if (text.size() % 4 == 1) return std::nullopt;
  std::vector<uint8_t> bytes;
  bytes.reserve(text.size() / 4 * 3 + 2);
  uint32_t bits = 0;
  int bit_count = 0;
  for (size_t i = 0; i < text.size(); ++i) {
    cancel_point_at(i);
    const int digit = base64_digit(text[i]);
    if (digit < 0) return std::nullopt;
    bits = bits << 6 | static_cast<uint32_t>(digit);
    bit_count += 6;
    if (bit_count < 8) continue;
    bit_count -= 8;
    bytes.push_back(static_cast<uint8_t>(bits >> bit_count));
  }
  return bytes;
}

}  // namespace

Result<Container> open_container(std::string_view name, std::span<const uint8_t> bytes) {
  Container container;
  container.json = as_text(bytes);
  container.is_glb = bytes.size() >= 4 && u32_at(bytes, 0) == kMagic;
  if (!container.is_glb) return container;
  VOXELD_ASSIGN(const size_t length, checked_length(name, bytes));
  for (size_t at = kHeaderBytes; at < length;) {
    // The last chunk may be followed by up to 3 bytes of padding.
    if (length - at < 4 && at > kHeaderBytes) break;
    if (length - at < kChunkHeaderBytes) {
      return malformed_at(name, at, "the header of a GLB chunk is cut off",
                          bytes_text(kChunkHeaderBytes), bytes_text(length - at));
    }
    const size_t chunk_bytes = u32_at(bytes, at);
    const uint32_t type = u32_at(bytes, at + 4);
    const size_t left = length - at - kChunkHeaderBytes;
    if (chunk_bytes > left) {
      return malformed_at(name, at, "a GLB chunk is longer than the file",
                          "at most " + bytes_text(left), bytes_text(chunk_bytes));
    }
    const auto chunk = bytes.subspan(at + kChunkHeaderBytes, chunk_bytes);
    if (at == kHeaderBytes && type != kJsonChunk) {
      return malformed_at(name, at + 4, "type of the first GLB chunk", "JSON",
                          shown(as_text(bytes.subspan(at + 4, 4))));
    }
    if (at == kHeaderBytes) container.json = as_text(chunk);
    if (type == kBinChunk && !container.bin) container.bin = chunk;
    at += kChunkHeaderBytes + chunk_bytes;
  }
  return container;
}

bool is_data_uri(std::string_view uri) {
  return uri.starts_with("data:");
}

std::optional<std::vector<uint8_t>> decode_data_uri(std::string_view uri) {
  const size_t comma = uri.find(',');
  if (!is_data_uri(uri) || comma == uri.npos) return std::nullopt;
  const std::string_view body = uri.substr(comma + 1);
  const bool is_base64 = uri.substr(0, comma).ends_with(";base64");
  if (is_base64 && body.find('%') == body.npos) return decode_base64(body);
  const std::string plain = percent_decoded(body);
  if (is_base64) return decode_base64(plain);
  return std::vector<uint8_t>(plain.begin(), plain.end());
}

}  // namespace voxeld::gltf
