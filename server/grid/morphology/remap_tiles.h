// A grid whose labels have other numbers.
#pragma once

#include <vector>

#include "proto/options/options.h"
#include "server/grid/tile_source.h"

namespace voxeld {

// The tiles of another source with the labels of `changes`, which are ascending by `from`. All
// changes happen at once: 1:2,2:1 exchanges two labels. The source must outlive it.
class RemapTiles final : public TileSource {
 public:
  // Needs channel label, and changes from and to numbers above 0.
  RemapTiles(const TileSource& source, std::vector<LabelChange> changes);
  Result<SparseTile> tile(size_t index) const override;
  uint64_t voxels(size_t index) const override { return source_.voxels(index); }
  size_t batch() const override { return source_.batch(); }

 private:
  const TileSource& source_;
  std::vector<LabelChange> changes_;
};

}  // namespace voxeld
