// The outer shells of glTF data: the GLB container of a file, and data: URIs in its JSON.
//
//   GLB, little endian:  0 "glTF"  4 u32 version (2)  8 u32 bytes of the file, with this header
//   then chunks:         0 u32 bytes  4 u32 type ("JSON", "BIN\0")  8 the bytes, padded to 4
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "proto/result.h"

namespace voxeld::gltf {

struct Container {
  std::string_view json;
  std::optional<std::span<const uint8_t>> bin;  // of the BIN chunk
  bool is_glb = false;
};

// Opens a GLB, or JSON as it is, by the first bytes. The views point into `bytes`. Chunks of
// unknown types are skipped, as the specification demands. Errors: malformed-mesh with the byte,
// unsupported-feature for a container version other than 2.
Result<Container> open_container(std::string_view name, std::span<const uint8_t> bytes);

bool is_data_uri(std::string_view uri);
// The bytes of "data:[type][;base64],…" (RFC 2397); nullopt if the URI is another or broken. Base64
// may use both alphabets of RFC 4648, and its padding may be missing.
std::optional<std::vector<uint8_t>> decode_data_uri(std::string_view uri);

}  // namespace voxeld::gltf
