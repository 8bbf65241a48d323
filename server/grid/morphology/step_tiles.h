// Grids whose voxels grow, shrink or are hollowed by steps of one cell.
#pragma once

#include <cstdint>
#include <vector>

#include "proto/options/options.h"
#include "server/grid/tile_source.h"

namespace voxeld {

enum class StepKind { kDilate, kErode, kHollow };

// The tiles of another source after `steps` of binary dilation or erosion, where cells outside the
// grid are empty; or its voxels that the erosion would remove. A voxel that dilation adds has the
// values of its first neighbour of the step before: one at a face before one at an edge before one
// at a corner, then by lowest z, y and x; and full coverage. A tile is made from the source's cells
// within `steps` of it. The source must outlive it.
class StepTiles final : public TileSource {
 public:
  // Needs 1 <= steps <= limits::kMorphologyStepsMax, and no channel of distances if it dilates.
  StepTiles(const TileSource& source, StepKind kind, int steps, Neighbors neighbors);
  Result<SparseTile> tile(size_t index) const override;
  size_t batch() const override { return cached_.batch(); }

 private:
  CachedTiles cached_;
  StepKind kind_;
  int steps_;
  Neighbors neighbors_;
};

// Bytes that StepTiles needs to make one tile, beside the source's tiles.
int64_t step_tile_bytes(int steps, const ChannelSet& channels);

}  // namespace voxeld
