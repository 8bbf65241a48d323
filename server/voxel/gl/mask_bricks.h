// The bricks of tiles' masks that lie in the machine's own memory, as those of software drivers do.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/sparse_tile.h"
#include "server/voxel/cpu/worker_pool.h"
#include "server/voxel/tile_mask.h"

namespace voxeld {

// A mask as bricks: the same bytes, proto/sparse_tile.h, on little-endian machines.
inline constexpr size_t kTileMaskBricks = kTileMaskBytes / sizeof(BrickMask);

// Keeps its memory from call to call. One thread calls.
class MaskBricks {
 public:
  // Appends the bricks of blocks[i] (as TileWindow::blocks) of the i-th mask that are not empty to
  // tiles[i], in order, and leaves them empty in `masks`, of kTileMaskBricks each.
  void take(std::span<BrickMask> masks, std::span<const uint64_t> blocks, WorkerPool& pool,
            std::span<SparseTile> tiles);

 private:
  struct Block {
    size_t slot = 0, first = 0;   // first brick in `masks`
    size_t place = 0, count = 0;  // of its bricks in the tile; how many there are
  };
  void find(std::span<const BrickMask> masks, size_t index);

  std::vector<Block> blocks_;
  std::vector<uint32_t> found_;  // numbers of bricks in `masks`, block after block
};

}  // namespace voxeld
