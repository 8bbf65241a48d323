// The point of a triangle that is nearest to the origin: color=nearest.
#pragma once

#include <array>

#include <glm/vec3.hpp>

namespace voxeld {

struct NearestPoint {
  double squared = 0;                 // squared distance, in the corners' unit squared
  glm::ivec3 weights{1 << 24, 0, 0};  // weights of the corners, sum 2^24
};

// The nearest point of a closed triangle, which may be a segment or a point, as README.md defines
// it ("color=nearest"). Computed in doubles without fused multiply-add. Corners are integers of at
// most 2^22 in ascending order. Triangles with a common side or corner therefore agree on its
// distance to the last bit. Eberly 1999, "Distance between point and triangle in 3D", sorts the
// same cases by regions.
NearestPoint nearest_point(const std::array<glm::dvec3, 3>& corners);

}  // namespace voxeld
