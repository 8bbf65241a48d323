// Which point of a triangle is nearest to another point: color=nearest.
#pragma once

#include <array>

#include <glm/vec3.hpp>

namespace voxeld {

struct NearestPoint {
  double squared = 0;                 // distance, in the corners' unit squared
  glm::ivec3 weights{1 << 24, 0, 0};  // of the corners, sum 2^24
};

// Of the origin to a closed triangle, which may be a segment or a point; as README.md writes it
// ("color=nearest"), in doubles without fused multiply-add. Corners: integers of at most 2^22, in
// ascending order, so that triangles with a common side or corner agree to the last bit about its
// distance. (Eberly 1999, "Distance between point and triangle in 3D", sorts the same cases by
// regions.)
NearestPoint nearest_point(const std::array<glm::dvec3, 3>& corners);

}  // namespace voxeld
