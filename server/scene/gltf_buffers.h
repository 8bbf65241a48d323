// The bytes that a glTF file refers to: its BIN chunk, data: URIs, files of the bundle.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "proto/result.h"
#include "server/scene/gltf_container.h"
#include "server/scene/load.h"

namespace voxeld {

// Bytes of all buffers together, as read: malformed-mesh above. Several buffers may name one file,
// so a bound on the upload alone would not bound this.
inline constexpr uint64_t kGltfBufferBytesMax = uint64_t{8} << 30;

// One element of "buffers", at least byteLength long.
struct GltfBuffer {
  std::vector<uint8_t> owned;      // empty for the BIN chunk
  std::span<const uint8_t> bytes;  // exactly byteLength
};

// Of a document that passed check_gltf_schema. Errors: malformed-mesh for a buffer that is missing,
// broken or shorter than byteLength, naming it; the bundle's own errors.
Result<std::vector<GltfBuffer>> load_gltf_buffers(std::string_view name,
                                                  const nlohmann::json& document,
                                                  const GltfContainer& container,
                                                  const Bundle& bundle);

bool is_data_uri(std::string_view uri);
// The bytes of "data:[type][;base64],…" (RFC 2397). nullopt where it is none, or broken. Base64 may
// use both alphabets of RFC 4648, and its padding may be missing.
std::optional<std::vector<uint8_t>> decode_data_uri(std::string_view uri);

}  // namespace voxeld
