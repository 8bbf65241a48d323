// The distances of one grid, from its mesh and the cells inside it.
#pragma once

#include <map>
#include <vector>

#include "proto/options/options.h"
#include "proto/result.h"
#include "server/grid/grid_spec.h"
#include "server/voxel/solid/distance/distance_field.h"

namespace voxeld {

// The lengths of a voxel's edges in the unit of distances. For world units the shortest edge is 1.
glm::dvec3 distance_scale(const GridSpec& spec, DistanceUnit unit);

// Measures distances. Not thread-safe.
class DistanceMaker {
 public:
  // scale: distance_scale(). inside: the cells whose distance is negative. The mesh need not
  // outlive the constructor, but the team must outlive this object.
  DistanceMaker(const FillMesh& mesh, const glm::ivec3& dims, const glm::dvec3& scale,
                std::vector<SparseTile> inside, ThreadTeam& team);

  // The cells at most `thickness` voxels from the mesh, whatever the scale, all as masks, in any
  // order. Distances in voxels are stored for measure(). Errors: those of `progress`, as
  // find_band(). Called at most once, before measure().
  Result<std::vector<SparseTile>> band(double thickness, const ColumnProgress& progress);

  // Sets SparseTile::distance of all voxels of masks.
  Status measure(const ColumnProgress& progress, std::vector<SparseTile>& tiles);

 private:
  TriangleTree triangles_;
  std::vector<SparseTile> inside_;
  BrickIndex index_;
  glm::ivec3 dims_;
  glm::dvec3 scale_;
  ThreadTeam& team_;
  std::map<std::array<int32_t, 3>, DistanceTile> band_;  // by coord
};

}  // namespace voxeld
