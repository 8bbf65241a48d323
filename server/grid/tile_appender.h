// Builds a tile from voxels that come in Morton order.
#pragma once

#include <array>
#include <cstdint>

#include "proto/codec/sparse_tile.h"
#include "server/grid/grid.h"

namespace voxeld {

// The attributes of one voxel. The defaults, all zero with full coverage, mean "none", as for the
// voxels of full nodes.
struct VoxelValues {
  std::array<uint8_t, 4> color{};  // sRGB R, G, B and linear A
  std::array<int8_t, 3> normal{};
  uint16_t material = 0, label = 0;
  int16_t distance = 0;
  uint8_t coverage = 255;
  bool none() const { return *this == VoxelValues{}; }
  bool operator==(const VoxelValues&) const = default;
};

// The values of voxel `index` among those with attributes. Channels that the tile lacks have
// defaults; kNoAttributes gives only defaults.
VoxelValues values_of(const SparseTile& tile, size_t index);

class TileAppender {
 public:
  TileAppender(const std::array<int32_t, 3>& coord, const ChannelSet& channels);

  // code: the cell's Morton code in the tile, 24 bits; must exceed that of the voxel before.
  void add(uint32_t code, const VoxelValues& values);
  // Returns the canonical tile. Full bricks without values become full nodes.
  SparseTile finish();

 private:
  void close_brick();

  SparseTile tile_;
  ChannelSet channels_;
  bool has_brick_ = false, has_values_ = false;
  uint32_t brick_ = 0;
  BrickMask mask_;
};

}  // namespace voxeld
