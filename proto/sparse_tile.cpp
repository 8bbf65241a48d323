#include "proto/sparse_tile.h"

#include <bit>

namespace voxeld {

size_t SparseTile::voxel_count() const {
  size_t count = 0;
  for (const BrickMask& mask : masks) {
    for (const uint64_t word : mask.words) count += static_cast<size_t>(std::popcount(word));
  }
  return count;
}

}  // namespace voxeld
