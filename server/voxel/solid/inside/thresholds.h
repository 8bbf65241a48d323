// The thresholds of WindingField for the bricks of one tile, computed on demand.
#pragma once

#include <array>
#include <cstdint>

#include "server/voxel/solid/inside/tile_bits.h"
#include "server/voxel/solid/inside/winding_field.h"

namespace voxeld {

class Thresholds {
 public:
  // Starts the tile whose first cell is `first`. Bricks are evaluated only when they are asked for.
  void begin_tile(const WindingField* field, const glm::ivec3& first);

  // True if some cell of the tile may have a threshold other than 1.
  bool any() const { return any_; }
  // The threshold of the whole brick, or kMixed.
  int of_brick(int x, int y, int z);
  // The thresholds of all cells of a brick, x fastest, then y, then z.
  void of_cells(int x, int y, int z, std::array<int, 512>& thresholds) const;

  static constexpr int kMixed = 1 << 30;

 private:
  static constexpr int kUnknown = kMixed + 1;
  static constexpr int kBlockBricks = 8;  // along a side of a block
  static constexpr int kBlocks = kTileBricks / kBlockBricks;

  void add_cells(const glm::ivec3& first, int side, const glm::ivec3& brick_first,
                 std::array<int, 512>& thresholds) const;

  const WindingField* field_ = nullptr;
  glm::ivec3 first_{0};
  bool any_ = false;
  std::array<int, size_t{kBlocks} * kBlocks * kBlocks> blocks_{};
};

}  // namespace voxeld
