#include "server/voxel/solid/inside/fill_mesh.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <glm/matrix.hpp>

#include "server/base/parallel.h"
#include "server/base/pieces.h"

namespace voxeld {
namespace {

constexpr size_t kVertexGrain = 1 << 15;

int32_t snap_anywhere(double p_grid, int dim, int sub_voxel_bits) {
  // Inside the box to which the surface is clipped, vertices must snap as the surface's do.
  if (p_grid >= -1.0 && p_grid <= dim + 1.0) return snap_coordinate(p_grid, dim);
  const double q = std::floor(std::ldexp(p_grid, sub_voxel_bits));
  return static_cast<int32_t>(std::clamp(q, -double{kFillQMax}, double{kFillQMax}));
}

bool has_all_triangles(const Scene& scene, const SnappedMesh& mesh) {
  return mesh.triangles.size() == scene.triangle_count() && mesh.clipped.empty();
}

}  // namespace

void FillMesh::own(std::vector<glm::ivec3> vertices, std::vector<uint32_t> indices) {
  own_vertices_ = std::move(vertices);
  own_indices_ = std::move(indices);
  vertices_ = own_vertices_;
  first_index_ = own_indices_.data();
  index_stride_ = 3;
  triangle_count_ = own_indices_.size() / 3;
}

FillMesh FillMesh::of(const Scene& scene, const glm::dmat4& world_from_file, const GridSpec& spec,
                      const SnappedMesh& mesh) {
  FillMesh fill;
  fill.sub_voxel_bits_ = limits::kSubVoxelBits;
  fill.mirrored_ = glm::determinant(world_from_file) < 0;
  if (has_all_triangles(scene, mesh)) {
    static_assert(sizeof(SnappedTriangle) % sizeof(uint32_t) == 0);
    fill.vertices_ = mesh.vertices;
    fill.triangle_count_ = mesh.triangles.size();
    fill.index_stride_ = sizeof(SnappedTriangle) / sizeof(uint32_t);
    if (!mesh.triangles.empty()) fill.first_index_ = mesh.triangles.front().vertices.data();
    return fill;
  }
  std::vector<glm::ivec3> vertices;
  resize_in_pieces(vertices, scene.vertex_count());
  std::vector<uint32_t> indices;
  indices.reserve(3 * scene.triangle_count());
  size_t base = 0;
  for (const MeshPart& part : scene.parts) {
    parallel_chunks(part.positions.size(), kVertexGrain, [&](size_t, size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        cancel_point_at(i);
        const glm::dvec3 p =
            spec.grid_from_world(glm::dvec3(world_from_file * glm::dvec4(part.positions[i], 1.0)));
        for (int axis = 0; axis < 3; ++axis) {
          vertices[base + i][axis] = snap_anywhere(p[axis], spec.dims[axis], limits::kSubVoxelBits);
        }
      }
    });
    for (const uint32_t index : part.indices) {
      cancel_point();
      indices.push_back(static_cast<uint32_t>(base) + index);
    }
    base += part.positions.size();
  }
  fill.own(std::move(vertices), std::move(indices));
  return fill;
}

int64_t FillMesh::own_bytes(const Scene& scene, const SnappedMesh& mesh) {
  if (has_all_triangles(scene, mesh)) return 0;
  return static_cast<int64_t>(scene.vertex_count() * sizeof(glm::ivec3) +
                              scene.triangle_count() * 3 * sizeof(uint32_t));
}

FillMesh FillMesh::scaled(int bits) const {
  FillMesh fill;
  fill.vertices_ = vertices_;
  fill.first_index_ = first_index_;
  fill.index_stride_ = index_stride_;
  fill.triangle_count_ = triangle_count_;
  fill.sub_voxel_bits_ = sub_voxel_bits_ - bits;
  fill.mirrored_ = mirrored_;
  return fill;
}

FillMesh FillMesh::of(std::vector<glm::ivec3> corners, int sub_voxel_bits) {
  FillMesh fill;
  fill.sub_voxel_bits_ = sub_voxel_bits;
  std::vector<uint32_t> indices = numbers_in_pieces(corners.size());
  fill.own(std::move(corners), std::move(indices));
  return fill;
}

}  // namespace voxeld
