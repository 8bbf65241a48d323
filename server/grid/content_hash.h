// The content hash of a grid: equal grids have equal hashes, whatever pipeline or file they are
// from.
#pragma once

#include <string>

#include "server/base/sha256.h"
#include "server/grid/grid.h"

namespace voxeld {

// Hashes dims, origin, voxel size, occupancy and attributes, but not meta. Equal grids of other
// pipelines, drivers and formats therefore have equal hashes. "sha256-<64 hex>".
std::string content_hash(const Grid& grid);

// Hashes a grid whose tiles come one by one.
class ContentHasher {
 public:
  // Uses the placement and channels of `grid`; its tiles are ignored.
  explicit ContentHasher(const Grid& grid);
  // Adds a tile. Tiles must be in ascending Morton order of coord. Empty tiles are ignored.
  void add(const SparseTile& tile);
  std::string finish() { return hash_.finish_id(); }

 private:
  Sha256 hash_;
};

}  // namespace voxeld
