// The points of the lattice between cells that are vertices of a mesh.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <vector>

#include "server/formats/bricks/brick_index.h"
#include "server/formats/bricks/voxel_bricks.h"

namespace voxeld::mesh {

// A point in cells from a tile's first one: on each axis 0..256, where 256 lies in the next tile.
using TilePoint = std::array<int, 3>;

// Bricks of points: a brick holds the points at the lower corners of its cells.
class LatticePoints {
 public:
  // For all corners of the voxels' bricks.
  explicit LatticePoints(const VoxelBricks& voxels);

  const BrickIndex& index() const { return index_; }
  const Planes& marks(uint32_t brick) const { return marks_[brick]; }
  // The number of a point's brick, which exists for each corner of a brick of voxels. tile: of the
  // voxels.
  uint32_t brick_of(uint32_t tile, const TilePoint& p) const {
    return index_.find(tile_of_[tile], p[0] >> 3, p[1] >> 3, p[2] >> 3);
  }
  // A point's number in its brick is z << 6 | y << 3 | x of the lowest three bits of each.
  // Thread-safe, but not beside is_marked().
  void mark(uint32_t brick, uint32_t in_brick) {
    std::atomic_ref<uint64_t> plane(marks_[brick][in_brick >> 6]);
    const uint64_t bit = uint64_t{1} << (in_brick & 63);
    if ((plane.load(std::memory_order_relaxed) & bit) != 0) return;
    plane.fetch_or(bit, std::memory_order_relaxed);
  }
  bool is_marked(uint32_t brick, uint32_t in_brick) const {
    return (marks_[brick][in_brick >> 6] >> (in_brick & 63) & 1) != 0;
  }

 private:
  BrickIndex index_;
  std::vector<uint32_t> tile_of_;  // by tile of voxels: that of the points at the same place
  std::vector<Planes> marks_;
};

}  // namespace voxeld::mesh
