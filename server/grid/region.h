// A box of a grid as a grid of its own, and the selection that a request makes from a grid.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "proto/options/options.h"
#include "server/grid/tile_source.h"

namespace voxeld {

// The axes along which cells are in reverse order.
using MirrorAxes = std::array<bool, 3>;

// The cells [box.min, box.max) of another source, which become [0, box.max - box.min). The box
// keeps its place in the world. Along mirrored axes the last cell becomes the first one, and
// normals point the other way. Only source tiles that the box touches are read, each for up to
// eight tiles of the region. The source must outlive it.
class RegionTiles final : public TileSource {
 public:
  // Needs 0 <= min < max <= dims on each axis.
  RegionTiles(const TileSource& source, const CellBox& box, const MirrorAxes& mirror = {});
  Result<SparseTile> tile(size_t index) const override;
  size_t batch() const override { return cached_.batch(); }

 private:
  // The cells of the region that are those of the source in the box, and the reverse.
  CellBox reflected(const CellBox& cells) const;

  CachedTiles cached_;
  CellBox box_;
  MirrorAxes mirror_;
};

// Applies level, level_rule, region, alpha, keep, dilate, erode, hollow, mirror, remap and palette
// of a request to a grid, and the box that its crop has become (occupied_selection()).
class Selection {
 public:
  // The source must outlive it. The colours of a .vox are left to its encoder, which knows their
  // order. `crop`: the cells of the level that remain at the end, all if it is empty. keep reads
  // the tiles. Needs channel label to remap, and none of distances to dilate. Errors:
  // invalid-option for a region outside the grid, and the source's.
  static Result<Selection> open(const TileSource& source, const OutputOptions& options,
                                const CellBox& crop = {});

  const TileSource& tiles() const { return *last_; }
  // The selected cells, at the requested level.
  const CellBox& box() const { return box_; }

 private:
  Selection() = default;
  void push(std::unique_ptr<TileSource> stage);
  void push_level(const TileSource& source, const OutputOptions& options);
  Status push_morphology(const OutputOptions& options);

  std::vector<std::unique_ptr<TileSource>> stages_;
  const TileSource* last_ = nullptr;
  CellBox box_;
};

// The occupied cells among those that level and region select, as keep, dilate, erode and hollow
// leave them, in cells of the level. Empty if there are none. Errors: as Selection::open(), and the
// source's.
Result<CellBox> occupied_selection(const TileSource& source, const OutputOptions& options);
// The options with a region of these cells of the level in place of crop; unless the box is empty.
// They tell a selection's place alone: its voxels may depend on cells beside the region.
OutputOptions crop_to(const OutputOptions& options, const GridSpec& spec, const CellBox& box);

// The region in cells of `level`: all cubes that it touches, or the whole level if there is no
// region. Errors: invalid-option if it is empty or reaches beyond the grid.
Result<CellBox> region_at_level(const GridSpec& spec, const OutputOptions& options, int level);

}  // namespace voxeld
