// A grid whose colours are those of a palette.
#pragma once

#include <vector>

#include "proto/options/options.h"
#include "server/grid/color/rgb.h"
#include "server/grid/tile_source.h"

namespace voxeld {

// The tiles of another source, with colours chosen as choose_entries() does. Voxels keep their
// alpha. The source must have colours and outlive it.
class PaletteTiles final : public TileSource {
 public:
  // Needs 1 to 256 colours.
  PaletteTiles(const TileSource& source, std::vector<Rgb> colors, Dither dither);
  Result<SparseTile> tile(size_t index) const override;
  uint64_t voxels(size_t index) const override { return source_.voxels(index); }
  size_t batch() const override { return source_.batch(); }

 private:
  const TileSource& source_;
  std::vector<Rgb> colors_;
  Dither dither_;
};

}  // namespace voxeld
