// Builds a tile from voxels that come in Morton order.
#pragma once

#include <array>
#include <cstdint>

#include "proto/sparse_tile.h"
#include "server/grid/grid.h"

namespace voxeld {

// The attributes of one voxel. All zero and covered entirely is "none", what the voxels of full
// nodes have.
struct VoxelValues {
  std::array<uint8_t, 4> color{};  // sRGB R, G, B and linear A
  std::array<int8_t, 3> normal{};
  uint16_t material = 0, label = 0;
  int16_t distance = 0;
  uint8_t coverage = 255;
  bool none() const { return *this == VoxelValues{}; }
  bool operator==(const VoxelValues&) const = default;
};

// Voxel `index` of those of a tile that have attributes; as by default for channels that the
// tile does not have, and for kNoAttributes.
VoxelValues values_of(const SparseTile& tile, size_t index);

class TileAppender {
 public:
  TileAppender(const std::array<int32_t, 3>& coord, const ChannelSet& channels);

  // code: of the cell in the tile, 24 bits; above that of the voxel before.
  void add(uint32_t code, const VoxelValues& values);
  // The tile, canonical. Entirely occupied bricks without values are full nodes.
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
