// The thresholds of WindingField for the bricks of a tile.
#pragma once

#include <array>
#include <cstdint>

#include "server/voxel/solid/tile_bits.h"
#include "server/voxel/solid/winding_field.h"

namespace voxeld {

class Thresholds {
 public:
  // Of the tile whose first cell is `first`. Bricks are looked at when they are asked for.
  void begin_tile(const WindingField* field, const glm::ivec3& first);

  // Whether some cell of the tile may have another threshold than 1.
  bool any() const { return any_; }
  // One for the whole brick, or kMixed.
  int of_brick(int x, int y, int z);
  // Of all cells of a brick, x fastest, then y, then z.
  void of_cells(int x, int y, int z, std::array<int, 512>& thresholds) const;

  static constexpr int kMixed = 1 << 30;

 private:
  static constexpr int kUnknown = kMixed + 1;
  static constexpr int kBlockBricks = 8;  // to a side of a block
  static constexpr int kBlocks = kTileBricks / kBlockBricks;

  void add_cells(const glm::ivec3& first, int side, const glm::ivec3& brick_first,
                 std::array<int, 512>& thresholds) const;

  const WindingField* field_ = nullptr;
  glm::ivec3 first_{0};
  bool any_ = false;
  std::array<int, size_t{kBlocks} * kBlocks * kBlocks> blocks_{};
};

}  // namespace voxeld
