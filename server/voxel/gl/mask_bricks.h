// The bricks of a tile's mask that lies in the machine's own memory, as that of software drivers
// does.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "proto/sparse_tile.h"
#include "server/voxel/cpu/worker_pool.h"
#include "server/voxel/tile_mask.h"

namespace voxeld {

// A mask as bricks: the same bytes, proto/sparse_tile.h, on little-endian machines.
inline constexpr size_t kTileMaskBricks = kTileMaskBytes / sizeof(BrickMask);

// Keeps its memory from tile to tile. One thread calls.
class MaskBricks {
 public:
  // Appends the bricks of `blocks` (as TileWindow::blocks) that are not empty to `tile`, in order,
  // and leaves them empty in `mask`, of kTileMaskBricks.
  void take(std::span<BrickMask> mask, uint64_t blocks, WorkerPool& pool, SparseTile& tile);

 private:
  std::array<uint32_t, kTileMaskBricks> found_{};  // numbers, block after block
};

}  // namespace voxeld
