#include "server/scene/core/polygon_sink.h"

#include "proto/limits.h"
#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/triangulate.h"

namespace voxeld {
namespace {

template <typename T>
std::vector<T> gathered(const std::vector<T>& values, const std::vector<uint32_t>& indices) {
  std::vector<T> out;
  if (values.empty()) return out;
  out.reserve(indices.size());
  in_pieces(indices.size(), kPieceElements<T>, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) out.push_back(values[indices[i]]);
  });
  return out;
}

}  // namespace

Status PolygonSink::add_face(std::span<const uint32_t> corners, MeshPart& part,
                             std::vector<uint32_t>* local) {
  cancel_point();
  triangle_count_ += static_cast<int64_t>(corners.size()) - 2;
  if (triangle_count_ > limits::kTrianglesMax) {
    return over_limit(name_, "", "too many triangles", limits::kTrianglesMax, triangle_count_);
  }
  if (corners.size() == 3) {
    for (const uint32_t corner : corners) push_in_pieces(part.indices, corner);
    if (local != nullptr) local->insert(local->end(), {0, 1, 2});
    return {};
  }
  points_.clear();
  for (const uint32_t corner : corners) points_.push_back(part.positions[corner]);
  triangles_.clear();
  triangulate_polygon(points_, triangles_);
  for (const uint32_t corner : triangles_) push_in_pieces(part.indices, corners[corner]);
  if (local != nullptr) local->insert(local->end(), triangles_.begin(), triangles_.end());
  return {};
}

MeshPart unshared(const MeshPart& part) {
  MeshPart out;
  out.name = part.name;
  out.material = part.material;
  out.positions = gathered(part.positions, part.indices);
  out.normals = gathered(part.normals, part.indices);
  out.uvs = gathered(part.uvs, part.indices);
  out.colors = gathered(part.colors, part.indices);
  out.indices = numbers_in_pieces(part.indices.size());
  return out;
}

MeshPart with_triangle_colors(const MeshPart& part, std::span<const glm::vec4> triangle_colors) {
  MeshPart out = unshared(part);
  out.colors.clear();
  out.colors.reserve(out.positions.size());
  for (const glm::vec4& color : triangle_colors) {
    cancel_point();
    out.colors.insert(out.colors.end(), 3, color);
  }
  return out;
}

}  // namespace voxeld
