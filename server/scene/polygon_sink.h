// Takes faces of any number of corners into a part's triangles.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/scene/scene.h"

namespace voxeld {

// Appends the face's triangles to part.indices; every corner must be < positions.size(). Faces with
// fewer than 3 corners must not come here. Errors: malformed-mesh over kTrianglesMax (`name`,
// `where` for the text), counting what the part already has.
class PolygonSink {
 public:
  explicit PolygonSink(std::string_view name) : name_(name) {}
  // `local` gets, per triangle corner, its number among the face's corners; may be null.
  Status add_face(std::span<const uint32_t> corners, MeshPart& part,
                  std::vector<uint32_t>* local = nullptr);

 private:
  std::string_view name_;
  int64_t triangle_count_ = 0;
  std::vector<glm::dvec3> points_;
  std::vector<uint32_t> triangles_;
};

// The part with a vertex of its own for every corner of a triangle, as colours per face need.
MeshPart unshared(const MeshPart& part);
// unshared(), with the colour of triangle i, triangle_colors[i], on its three corners.
MeshPart with_triangle_colors(const MeshPart& part, std::span<const glm::vec4> triangle_colors);

}  // namespace voxeld
