// The interface of the kernels of every instruction set. It uses plain pointers, because a kernel's
// translation unit must not instantiate inline functions of other headers. The linker would keep
// one copy for the whole program, perhaps the one with instructions that the machine lacks.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/base/simd/cpu_isa.h"

namespace voxeld {

// A tile in words of 4x4x4 cells; words and the bits in them are in Morton order. Bit b of word w
// is the cell whose Morton index in the tile is 64 w + b. On little-endian machines the bytes are
// those of TileDevice::read_mask. 8 words are a brick, 4096 a block of 64^3 cells.
inline constexpr size_t kTileWords = size_t{256} * 256 * 256 / 64;
inline constexpr size_t kBrickWords64 = 8;
inline constexpr size_t kBlockBricks = 512;
inline constexpr size_t kBlockWords = kBlockBricks * kBrickWords64;

// The memory of a kernel: the tile in words of Morton order, then again in words of rows
// (row_words.h). A cell is set if either says so. After them come words that lanes without work
// write to, and the blocks whose Morton words may be nonzero.
inline constexpr size_t kTouchRowsAt = kTileWords;
inline constexpr int32_t kUnusedRow = int32_t{kTileWords};  // counted from the first row
inline constexpr size_t kMortonBlocksAt = 2 * kTileWords + 16;
inline constexpr size_t kTouchWords = kMortonBlocksAt + 1;

struct TouchInput {
  const int32_t* vertices = nullptr;    // q, 3 per vertex
  const uint32_t* triangles = nullptr;  // 3 numbers of vertices each
  size_t triangle_stride = 3;           // in 32-bit words
  const uint32_t* list = nullptr;       // numbers of triangles whose boxes reach the tile
  size_t list_count = 0;
  int32_t tile_q[3] = {0, 0, 0};     // q of the tile's min corner
  int32_t cell_last[3] = {0, 0, 0};  // last cell of the tile inside the grid
};

// Bricks of one block, in Morton order.
struct CompactedBlock {
  uint32_t brick_morton[kBlockBricks];
  uint64_t masks[kBlockBricks][kBrickWords64];
  size_t brick_count;
  uint64_t voxel_count;
};

struct TouchKernel {
  // Sets the bits of all touched cells in kTouchWords words. Returns the blocks of 64^3 cells that
  // it may have written to; the bit is the block's Morton index.
  uint64_t (*touch)(const TouchInput& input, uint64_t* words);
  // The same for rule=thin and rule=center. The blocks are those of all touched cells.
  uint64_t (*thin)(const TouchInput& input, uint64_t* words);
  uint64_t (*center)(const TouchInput& input, uint64_t* words);
  // Joins block number `block` of several tiles of kTouchWords words, extracts the nonempty bricks,
  // and zeroes the block in all of the tiles.
  void (*compact)(uint64_t* const* tiles, size_t tile_count, size_t block, CompactedBlock* out);
  // Joins the block into the same block of `mask`, which has 32-bit words in Morton order, and
  // zeroes it in `tiles`.
  void (*join)(uint64_t* const* tiles, size_t tile_count, size_t block, uint32_t* mask);
};

extern const TouchKernel kTouchKernelPortable;
#if defined(__x86_64__)
extern const TouchKernel kTouchKernelSse4;
extern const TouchKernel kTouchKernelAvx2;
extern const TouchKernel kTouchKernelAvx512;
#endif

// The kernel of a set; CHECKs that the set is supported.
const TouchKernel& touch_kernel(CpuIsa isa);

}  // namespace voxeld
