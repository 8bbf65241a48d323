// Levels of detail of a grid: at level L one voxel stands for a cube of 2^L cells to a side. What
// the words mean: server/grid/README.md. Crassin, GigaVoxels (2009) draws from such a pyramid.
#pragma once

#include <utility>
#include <vector>

#include "proto/options.h"
#include "server/grid/tile_source.h"

namespace voxeld {

// Of kGridSideMax cells one voxel remains.
inline constexpr int kLevelMax = 14;

// dims = ceil(dims / 2^level), the same origin, voxels 2^level times as large.
GridSpec level_spec(const GridSpec& spec, int level);

// The tiles of a level, each made from the 8^level ones of the source under it, which are read
// once. The source must outlive it. In memory: the tile, and a batch of the source's.
class LevelTiles final : public TileSource {
 public:
  // level: 1 to kLevelMax.
  LevelTiles(const TileSource& source, int level, LevelRule rule);
  Result<SparseTile> tile(size_t index) const override;
  size_t batch() const override { return 1; }

 private:
  struct Part;
  Part reduce(size_t at) const;

  const TileSource& source_;
  int level_;
  uint64_t cells_min_;                            // occupied ones that an occupied voxel has
  std::vector<std::pair<size_t, size_t>> under_;  // of each tile: those of the source
};

}  // namespace voxeld
