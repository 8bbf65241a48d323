// Extraction of bricks from masks in host memory. Software drivers keep their buffers there.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "server/base/parallel.h"
#include "server/voxel/tiles/tile_mask.h"

namespace voxeld {

// Number of bricks of a mask. On little-endian machines a mask has the bytes of its bricks; see
// proto/codec/sparse_tile.h.
inline constexpr size_t kTileMaskBricks = kTileMaskBytes / sizeof(BrickMask);

// Takes bricks out of masks. It keeps its memory between calls. Not thread-safe.
class MaskBricks {
 public:
  // Moves the nonempty bricks of blocks[i] (see TileWindow::blocks) of mask i to tiles[i], in
  // order. It clears them in `masks`, which has kTileMaskBricks for each tile.
  void take(std::span<BrickMask> masks, std::span<const uint64_t> blocks, ThreadTeam& team,
            std::span<SparseTile> tiles);

 private:
  struct Block {
    size_t slot = 0, first = 0;   // first brick in `masks`
    size_t place = 0, count = 0;  // place and number of its bricks in the tile
  };
  void find(std::span<const BrickMask> masks, size_t index);

  std::vector<Block> blocks_;
  std::vector<uint32_t> found_;  // numbers of bricks in `masks`, block after block
};

}  // namespace voxeld
