// Triangulates simple polygons, also concave ones.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

namespace voxeld {

// Appends 3 corner numbers (0..corners.size()-1) per triangle to `out` and keeps the polygon's
// orientation. Every simple polygon gives corners.size() - 2 triangles. It clips ears (Meisters
// 1975) in the plane of Newell's normal. Self-intersecting or degenerate polygons fall back to a
// fan, so nothing is lost.
void triangulate_polygon(std::span<const glm::dvec3> corners, std::vector<uint32_t>& out);

}  // namespace voxeld
