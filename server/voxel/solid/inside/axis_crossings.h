// All crossings of a mesh with the columns along one axis, by tile column and tile.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/base/parallel.h"
#include "server/voxel/solid/inside/crossings.h"
#include "server/voxel/solid/inside/triangle_columns.h"

namespace voxeld {

// The crossings of one tile column, sorted by the tile of their first cell.
class TileCrossings {
 public:
  void set(std::span<const Crossing> crossings, int tiles);
  std::span<const Crossing> of_tile(int tile) const { return range(tile, tile + 1); }
  std::span<const Crossing> below_tile(int tile) const { return range(0, tile); }

 private:
  std::span<const Crossing> range(int first, int last) const {
    const size_t begin = first_[static_cast<size_t>(first)];
    return std::span(sorted_).subspan(begin, first_[static_cast<size_t>(last)] - begin);
  }
  std::vector<Crossing> sorted_;
  std::vector<size_t> first_;
};

class AxisCrossings {
 public:
  AxisCrossings(const FillMesh& mesh, int axis, const glm::ivec3& dims, ThreadTeam& team);

  const TileCrossings& column(int tile_u, int tile_v) const {
    return columns_[static_cast<size_t>(tile_v) * static_cast<size_t>(tiles_u_) +
                    static_cast<size_t>(tile_u)];
  }

 private:
  int tiles_u_ = 0;
  std::vector<TileCrossings> columns_;
};

}  // namespace voxeld
