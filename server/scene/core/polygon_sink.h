// Splits faces of any number of corners into a part's triangles.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/scene/core/scene.h"

namespace voxeld {

// Appends triangles to part.indices. Every corner must be < positions.size(), and a face must have
// 3 corners or more. Errors: malformed-mesh over kTrianglesMax, including the part's earlier
// triangles; `name` and `where` appear in the text.
class PolygonSink {
 public:
  explicit PolygonSink(std::string_view name) : name_(name) {}
  // `local`, which may be null, receives for each triangle corner its number in the face.
  Status add_face(std::span<const uint32_t> corners, MeshPart& part,
                  std::vector<uint32_t>* local = nullptr);

 private:
  std::string_view name_;
  int64_t triangle_count_ = 0;
  std::vector<glm::dvec3> points_;
  std::vector<uint32_t> triangles_;
};

// A copy of the part in which each triangle corner has a vertex of its own, as colours per face
// need.
MeshPart unshared(const MeshPart& part);
// An unshared() copy in which triangle i has the colour triangle_colors[i] on its three corners.
MeshPart with_triangle_colors(const MeshPart& part, std::span<const glm::vec4> triangle_colors);

}  // namespace voxeld
