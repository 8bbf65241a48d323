// Simple polygons to triangles, concave ones too.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

namespace voxeld {

// Appends 3 corner numbers (0..corners.size()-1) per triangle to `out`, keeping the polygon's
// orientation; corners.size() - 2 triangles for every simple polygon. Ear clipping (Meisters 1975)
// in the plane of Newell's normal; self-intersecting or degenerate polygons fall back to a fan, so
// nothing is lost.
void triangulate_polygon(std::span<const glm::dvec3> corners, std::vector<uint32_t>& out);

}  // namespace voxeld
