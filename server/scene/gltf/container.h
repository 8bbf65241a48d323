// The outer shell of a glTF file: JSON as it is, or a GLB container.
//
//   GLB, little endian:  0 "glTF"  4 u32 version (2)  8 u32 bytes of the file, with this header
//   then chunks:         0 u32 bytes  4 u32 type ("JSON", "BIN\0")  8 the bytes, padded to 4
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "proto/result.h"

namespace voxeld {

struct GltfContainer {
  std::string_view json;
  std::span<const uint8_t> bin;  // of the BIN chunk; empty: there is none
  bool has_bin = false;
  bool is_glb = false;
};

// Opens either form, by the first bytes. The views point into `bytes`. Chunks of unknown types are
// skipped, as the specification demands. Errors: malformed-mesh with the byte, unsupported-feature
// for a container version other than 2.
Result<GltfContainer> open_gltf_container(std::string_view name, std::span<const uint8_t> bytes);

}  // namespace voxeld
