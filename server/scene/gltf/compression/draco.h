// KHR_draco_mesh_compression: a primitive's indices and attributes as a mesh of Google's Draco
// library, bitstream version 2.2.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "proto/result.h"
#include "server/scene/gltf/document.h"

namespace voxeld::gltf {

// An attribute to read, with the type that its accessor declares.
struct DracoAttribute {
  std::string name;  // for errors: "POSITION"
  uint32_t id = 0;   // of the attribute in the Draco mesh
  int component_type = 0, component_count = 0;
  std::vector<uint8_t> values = {};  // result: point_count elements, tightly packed
};

// The counts and attributes that a primitive's accessors declare, and their data.
struct DracoMesh {
  uint64_t triangle_count = 0, point_count = 0;
  std::vector<DracoAttribute> attributes;
  std::vector<uint32_t> indices = {};  // result: three for each triangle
};

// Fills in the results of `mesh` from the stream `data`, whose own counts have to be those of
// `mesh`; they are compared before memory is allocated for them.
//
// Errors: malformed-mesh, which begins with `path`; unsupported-feature for another version of the
// bitstream.
Status decode_draco(const Document& document, const std::string& path,
                    std::span<const uint8_t> data, DracoMesh& mesh);

}  // namespace voxeld::gltf
