// A list of voxels in any order that becomes the tiles of a grid.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "server/grid/grid.h"
#include "server/grid/tile_appender.h"

namespace voxeld::volumes {

// Takes 8 bytes per voxel, and sizeof(VoxelValues) per entry of its table of values. The caller
// checks limits::kSparseVoxelsMax. Not thread-safe.
class VoxelList {
 public:
  // Adds an entry to the table of values and returns its number, for add(). Voxels may share it.
  uint32_t add_values(const VoxelValues& values);
  // Adds a voxel. cell: x, y, z of the grid, each 0..limits::kGridSideMax - 1. Where two voxels
  // have the same cell, the one that was added first stays.
  void add(const std::array<int32_t, 3>& cell, uint32_t values);

  // Voxels that were added, those in the same cell included.
  uint64_t size() const { return size_; }

  // Makes the tiles, in a grid's order, on all cores. Leaves the list empty. Throws Cancelled as
  // cancel_point() does.
  std::vector<SparseTile> finish(const ChannelSet& channels);

 private:
  // An eighth of a tile: small enough for the cores to share the sorting of one full tile.
  struct Octant {
    uint32_t order = 0;            // tile_order() << 3 | octant of the tile, in Morton order
    std::vector<uint64_t> voxels;  // Morton code in the tile << 32 | number of the values
  };

  static void sort(std::vector<uint64_t>& voxels);
  SparseTile tile_of(std::span<const Octant> octants, const ChannelSet& channels) const;

  std::vector<VoxelValues> values_;
  std::unordered_map<uint32_t, size_t> octant_of_;  // by order
  std::vector<Octant> octants_;
  size_t last_ = 0;  // octant of the voxel before
  uint64_t size_ = 0;
};

}  // namespace voxeld::volumes
