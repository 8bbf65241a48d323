// Levels of detail of a grid. At level L, one voxel stands for a cube of 2^L cells on a side.
// server/grid/README.md defines the terms. Crassin, GigaVoxels (2009) draws from such a pyramid.
#pragma once

#include <utility>
#include <vector>

#include "proto/options/options.h"
#include "server/grid/tile_source.h"

namespace voxeld {

// At this level one voxel remains of kGridSideMax cells.
inline constexpr int kLevelMax = 14;

// The placement of a level: dims = ceil(dims / 2^level), the same origin, voxels 2^level times as
// large.
GridSpec level_spec(const GridSpec& spec, int level);

// The tiles of a level. Each is made from up to 8^level tiles of the source, which are read once.
// The source must outlive it. In memory are the tile and a batch of the source's.
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
  bool is_solid_;
  uint64_t cells_min_;                            // occupied cells that make a voxel occupied
  std::vector<std::pair<size_t, size_t>> under_;  // for each tile, the range of source tiles
};

}  // namespace voxeld
