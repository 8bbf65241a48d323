// A box of a grid as a grid of its own, and the part of a grid that a request asks for.
#pragma once

#include <memory>
#include <vector>

#include "proto/options.h"
#include "server/grid/tile_source.h"

namespace voxeld {

// Of the cells [box.min, box.max) of another source, which become [0, box.max - box.min): the
// voxels stay where they are in the world. Of the source, tiles that the box touches are read, each
// for up to eight tiles of the region. The source must outlive it.
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

// What level, level_rule and region of a request make of a grid.
class Selection {
 public:
  // The source must outlive it. Errors: invalid-option for a region that is not in the grid.
  static Result<Selection> open(const TileSource& source, const OutputOptions& options);

  const TileSource& tiles() const { return *last_; }
  // The cells of the level, or of the grid, that the region asks for.
  const CellBox& box() const { return box_; }

 private:
  Selection() = default;
  std::vector<std::unique_ptr<TileSource>> stages_;
  const TileSource* last_ = nullptr;
  CellBox box_;
};

// Whether a request asks for less than the grid as it is.
bool selects(const OutputOptions& options);

// The region in cells of `level`: of the cubes that it touches; the whole level without one.
// Errors: invalid-option for one that is empty or reaches beyond the grid.
Result<CellBox> region_at_level(const GridSpec& spec, const OutputOptions& options, int level);

}  // namespace voxeld
