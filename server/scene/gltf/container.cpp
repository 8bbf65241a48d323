#include "server/scene/gltf/container.h"

#include <string>

#include "server/scene/mesh_error.h"
#include "server/scene/text_cursor.h"

namespace voxeld {
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

std::string byte_of(size_t at) {
  return "byte " + std::to_string(at);
}

std::string bytes_text(size_t count) {
  return std::to_string(count) + " bytes";
}

Result<size_t> checked_length(std::string_view name, std::span<const uint8_t> bytes) {
  if (bytes.size() < kHeaderBytes) {
    return malformed_mesh(name, byte_of(bytes.size()), "the GLB header is cut off",
                          bytes_text(kHeaderBytes), bytes_text(bytes.size()));
  }
  const uint32_t version = u32_at(bytes, 4);
  if (version != 2) {
    return Error{ErrorCode::kUnsupportedFeature,
                 std::string(name) + ": version of the GLB container", "2",
                 std::to_string(version)};
  }
  const size_t length = u32_at(bytes, 8);
  if (length > bytes.size()) {
    return malformed_mesh(name, byte_of(8), "the file is shorter than its header says",
                          bytes_text(length), bytes_text(bytes.size()));
  }
  if (length < kHeaderBytes + kChunkHeaderBytes) {
    return malformed_mesh(name, byte_of(8), "no room for the JSON chunk",
                          "at least " + bytes_text(kHeaderBytes + kChunkHeaderBytes),
                          bytes_text(length));
  }
  return length;
}

}  // namespace

Result<GltfContainer> open_gltf_container(std::string_view name, std::span<const uint8_t> bytes) {
  GltfContainer container;
  if (bytes.size() < 4 || u32_at(bytes, 0) != kMagic) {
    container.json = as_text(bytes);
    return container;
  }
  container.is_glb = true;
  VOXELD_ASSIGN(const size_t length, checked_length(name, bytes));
  for (size_t at = kHeaderBytes; at < length;) {
    // The last chunk may be followed by up to 3 bytes of padding.
    if (length - at < 4 && at > kHeaderBytes) break;
    if (length - at < kChunkHeaderBytes) {
      return malformed_mesh(name, byte_of(at), "the header of a GLB chunk is cut off",
                            bytes_text(kChunkHeaderBytes), bytes_text(length - at));
    }
    const size_t chunk_bytes = u32_at(bytes, at);
    const uint32_t type = u32_at(bytes, at + 4);
    if (chunk_bytes > length - at - kChunkHeaderBytes) {
      return malformed_mesh(name, byte_of(at), "a GLB chunk is longer than the file",
                            "at most " + bytes_text(length - at - kChunkHeaderBytes),
                            bytes_text(chunk_bytes));
    }
    const auto chunk = bytes.subspan(at + kChunkHeaderBytes, chunk_bytes);
    if (at == kHeaderBytes) {
      if (type != kJsonChunk) {
        return malformed_mesh(name, byte_of(at + 4), "type of the first GLB chunk", "JSON",
                              shown(as_text(bytes.subspan(at + 4, 4))));
      }
      container.json = as_text(chunk);
    } else if (type == kBinChunk && !container.has_bin) {
      container.bin = chunk;
      container.has_bin = true;
    }
    at += kChunkHeaderBytes + chunk_bytes;
  }
  return container;
}

}  // namespace voxeld
