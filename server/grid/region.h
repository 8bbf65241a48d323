// A box of a grid as a grid of its own, and the selection that a request makes from a grid.
#pragma once

#include <memory>
#include <vector>

#include "proto/options/options.h"
#include "server/grid/tile_source.h"

namespace voxeld {

// The cells [box.min, box.max) of another source, which become [0, box.max - box.min). Voxels keep
// their place in the world. Only source tiles that the box touches are read, each for up to eight
// tiles of the region. The source must outlive it.
class RegionTiles final : public TileSource {
 public:
  // Needs 0 <= min < max <= dims on each axis.
  RegionTiles(const TileSource& source, const CellBox& box);
  Result<SparseTile> tile(size_t index) const override;
  size_t batch() const override { return cached_.batch(); }

 private:
  Result<std::vector<SparseTile>> sources_of(const TileCoord& coord) const;

  CachedTiles cached_;
  CellBox box_;
};

// Applies level, level_rule and region of a request to a grid.
class Selection {
 public:
  // The source must outlive it. Errors: invalid-option for a region outside the grid.
  static Result<Selection> open(const TileSource& source, const OutputOptions& options);

  const TileSource& tiles() const { return *last_; }
  // The selected cells, at the requested level.
  const CellBox& box() const { return box_; }

 private:
  Selection() = default;
  std::vector<std::unique_ptr<TileSource>> stages_;
  const TileSource* last_ = nullptr;
  CellBox box_;
};

// Whether a request selects less than the whole grid at level 0.
bool selects(const OutputOptions& options);

// The region in cells of `level`: all cubes that it touches, or the whole level if there is no
// region. Errors: invalid-option if it is empty or reaches beyond the grid.
Result<CellBox> region_at_level(const GridSpec& spec, const OutputOptions& options, int level);

}  // namespace voxeld
