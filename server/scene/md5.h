// From MD5 joints to the parts of a scene.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "server/scene/md5_mesh.h"
#include "server/scene/scene.h"

namespace voxeld {

// Unit normals of vertices: of the faces around each place, weighted by their area; (0,0,1) where
// there are none. `indices`: clockwise seen from outside, as in the file.
std::vector<glm::dvec3> md5_normals(std::span<const glm::dvec3> positions,
                                    std::span<const uint32_t> indices);

// The part in a pose, with +y up and counter-clockwise triangles; without a material.
MeshPart md5_mesh_part(const Md5Part& part, const std::vector<Md5Joint>& joints);

}  // namespace voxeld
