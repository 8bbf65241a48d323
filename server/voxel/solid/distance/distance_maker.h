// The distances of one grid, from its mesh and the cells inside it.
#pragma once

#include <map>
#include <vector>

#include "proto/result.h"
#include "server/voxel/solid/distance/distance_field.h"

namespace voxeld {

// Measures distances. Not thread-safe.
class DistanceMaker {
 public:
  // inside: the cells whose distance is negative. The mesh need not outlive the constructor, but
  // the team must outlive this object.
  DistanceMaker(const FillMesh& mesh, const glm::ivec3& dims, std::vector<SparseTile> inside,
                ThreadTeam& team);

  // The cells at most `thickness` voxels from the mesh, all as masks, in any order. Their distances
  // are stored for measure(). Errors: those of `progress`, as find_band().
  Result<std::vector<SparseTile>> band(double thickness, const ColumnProgress& progress);

  // Sets SparseTile::distance of all voxels of masks.
  Status measure(const ColumnProgress& progress, std::vector<SparseTile>& tiles) const;

 private:
  TriangleTree triangles_;
  std::vector<SparseTile> inside_;
  BrickIndex index_;
  glm::ivec3 dims_;
  ThreadTeam& team_;
  std::map<std::array<int32_t, 3>, DistanceTile> band_;  // by coord
};

}  // namespace voxeld
