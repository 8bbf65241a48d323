// The hash that says that two grids are equal, whatever made them and whatever file they are in.
#pragma once

#include <string>

#include "server/base/sha256.h"
#include "server/grid/grid.h"

namespace voxeld {

// Hash of dims, origin, voxel size, occupancy and attributes, without meta: equal grids from other
// pipelines, drivers and formats have equal hashes. "sha256-<64 hex>".
std::string content_hash(const Grid& grid);

// The same for a grid whose tiles come one by one.
class ContentHasher {
 public:
  // Of `grid`, its place and channels count.
  explicit ContentHasher(const Grid& grid);
  // In ascending Morton order of coord. Empty tiles do not count.
  void add(const SparseTile& tile);
  std::string finish() { return hash_.finish_id(); }

 private:
  Sha256 hash_;
};

}  // namespace voxeld
