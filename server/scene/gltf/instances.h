// EXT_mesh_gpu_instancing: the copies of a node's mesh.
#pragma once

#include <cstddef>
#include <vector>

#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>

#include "proto/result.h"
#include "server/scene/gltf/accessor.h"
#include "server/scene/gltf/document.h"

namespace voxeld::gltf {

// Copies of the meshes of all nodes; each takes some 300 bytes. More: malformed-mesh.
inline constexpr size_t kInstancesMax = size_t{1} << 20;

struct Instances {
  std::vector<glm::dmat4> node_from_instance;
  // Linear, in [0, 1], multiplied with those of the mesh; empty: none. From _COLOR_0, which the
  // extension leaves to writers; three.js and Babylon.js read it, too.
  std::vector<glm::vec4> colors;
};

// The copies of node `index`, which has `instances`. Errors: malformed-mesh with the path; those of
// Accessors::open().
Result<Instances> read_instances(const Document& document, Accessors& accessors, int index);

}  // namespace voxeld::gltf
