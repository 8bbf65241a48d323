// From MD5 joints to a scene.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include <glm/vec3.hpp>

#include "proto/result.h"
#include "server/scene/load.h"
#include "server/scene/md5_mesh.h"
#include "server/scene/scene.h"

namespace voxeld {

// Unit normals of vertices: of the faces around each place, weighted by their area; (0,0,1) where
// there are none. `indices`: clockwise seen from outside, as in the file.
std::vector<glm::dvec3> md5_normals(std::span<const glm::dvec3> positions,
                                    std::span<const uint32_t> indices);

// The files have +z up, scenes +y.
template <typename Vec>
Vec y_up_from_z_up(const Vec& p) {
  return Vec(p.x, p.z, -p.y);
}

// The part in a pose, with +y up and counter-clockwise triangles; without a material.
MeshPart md5_mesh_part(const Md5Part& part, const std::vector<Md5Joint>& joints);

// The mesh in its bind pose. Takes its warnings. Errors: empty-mesh; malformed-mesh for a vertex
// that is too far away.
Result<Scene> md5_scene(std::string_view name, Md5Mesh& mesh, const Bundle& bundle,
                        const LoadOptions& options);

}  // namespace voxeld
