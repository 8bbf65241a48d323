// Converts an MD5 mesh with its joints to a scene.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include <glm/vec3.hpp>

#include "proto/result.h"
#include "server/scene/core/loaders.h"
#include "server/scene/core/scene.h"
#include "server/scene/md5/mesh.h"

namespace voxeld {

// Unit normals of vertices: the area-weighted mean of the faces around each position; (0,0,1) if
// there are none. `indices` are clockwise seen from outside, as in the file.
std::vector<glm::dvec3> md5_normals(std::span<const glm::dvec3> positions,
                                    std::span<const uint32_t> indices);

// Turns a point of a file, with +z up, into one of a scene, with +y up.
template <typename Vec>
Vec y_up_from_z_up(const Vec& p) {
  return Vec(p.x, p.z, -p.y);
}

// The part in a pose, with +y up, counter-clockwise triangles and no material.
MeshPart md5_mesh_part(const Md5Part& part, const std::vector<Md5Joint>& joints);

// The mesh in its bind pose. Moves the mesh's warnings out. Errors: empty-mesh; malformed-mesh for
// a vertex that is too far away.
Result<Scene> md5_scene(std::string_view name, Md5Mesh& mesh, const Bundle& bundle,
                        const LoadOptions& options);

}  // namespace voxeld
