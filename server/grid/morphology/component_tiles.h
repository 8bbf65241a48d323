// The largest components of a grid's voxels.
#pragma once

#include <memory>
#include <vector>

#include "proto/options/options.h"
#include "server/grid/tile_source.h"

namespace voxeld {

// The tiles of another source with the voxels of its largest components alone. A component is a set
// of voxels that are connected by neighbours. Equally large ones are in the order of their first
// cells by z, y, x. The source must outlive it.
class ComponentTiles final : public TileSource {
 public:
  // Reads all tiles once, to find the components; count >= 1 of them remain. Errors: the source's.
  static Result<std::unique_ptr<ComponentTiles>> open(const TileSource& source, int count,
                                                      Neighbors neighbors);
  // Reads the source's tile again. The components of a tile have the same order as before.
  Result<SparseTile> tile(size_t index) const override;
  size_t batch() const override { return source_.batch(); }

 private:
  ComponentTiles(const TileSource& source, Neighbors neighbors);

  const TileSource& source_;
  Neighbors neighbors_;
  // Which of a tile's components remain, by the order of their first cells; for each tile.
  std::vector<std::vector<bool>> kept_;
};

}  // namespace voxeld
