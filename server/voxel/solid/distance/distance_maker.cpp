#include "server/voxel/solid/distance/distance_maker.h"

#include <algorithm>
#include <utility>

#include "server/base/cancel_point.h"

namespace voxeld {

glm::dvec3 distance_scale(const GridSpec& spec, DistanceUnit unit) {
  const glm::dvec3& size = spec.voxel_size;
  if (unit == DistanceUnit::kVoxels) return glm::dvec3(1.0);
  return size / std::min({size.x, size.y, size.z});
}

DistanceMaker::DistanceMaker(const FillMesh& mesh, const glm::ivec3& dims, const glm::dvec3& scale,
                             std::vector<SparseTile> inside, ThreadTeam& team)
    : triangles_(mesh),
      inside_(std::move(inside)),
      index_(inside_, dims),
      dims_(dims),
      scale_(scale),
      team_(team) {}

Result<std::vector<SparseTile>> DistanceMaker::band(double thickness,
                                                    const ColumnProgress& progress) {
  std::vector<DistanceTile> found;
  VOXELD_TRY(find_band({triangles_, dims_, index_}, thickness, team_, progress, found));
  std::vector<SparseTile> cells;
  for (DistanceTile& tile : found) {
    cancel_point();
    cells.push_back(tile.tile);
    if (scale_ != glm::dvec3(1.0)) continue;  // measured anew
    const auto coord = tile.tile.coord;
    band_.emplace(coord, std::move(tile));
  }
  return cells;
}

Status DistanceMaker::measure(const ColumnProgress& progress, std::vector<SparseTile>& tiles) {
  triangles_.set_scale(scale_);
  for (SparseTile& tile : tiles) {
    const auto known = band_.find(tile.coord);
    if (known != band_.end() && known->second.tile.masks == tile.masks &&
        known->second.tile.brick_morton == tile.brick_morton) {
      tile.distance = known->second.distance;
    } else {
      tile.distance = distances_of_tile({triangles_, dims_, index_}, tile, team_);
    }
    if (progress) VOXELD_TRY(progress(0));
  }
  return {};
}

}  // namespace voxeld
