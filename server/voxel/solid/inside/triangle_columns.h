// Binning for sweeps: the triangles that can cross the columns of each tile column.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "server/voxel/solid/inside/crossings.h"

namespace voxeld {

// The tile columns along one axis, numbered v * tiles_u + u.
class TriangleColumns {
 public:
  TriangleColumns(const FillMesh& mesh, int axis, const glm::ivec3& dims);

  int axis() const { return axis_; }
  int tiles_u() const { return tiles_u_; }
  int tiles_v() const { return tiles_v_; }
  size_t count() const { return static_cast<size_t>(tiles_u_) * static_cast<size_t>(tiles_v_); }
  // The triangles whose box reaches the centre of a column of cells in the tile column, ascending.
  // If there is only one tile column, these are all triangles.
  std::span<const uint32_t> triangles(size_t column) const {
    return std::span(list_).subspan(first_[column], first_[column + 1] - first_[column]);
  }
  ColumnWindow window(size_t column) const;

 private:
  int axis_;
  glm::ivec3 dims_;
  int tiles_u_, tiles_v_;
  std::vector<uint32_t> list_;
  std::vector<size_t> first_;
};

}  // namespace voxeld
