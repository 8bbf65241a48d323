// What the kernels of every instruction set offer. Plain pointers: a kernel's translation unit must
// not instantiate inline functions of other headers, because the linker would keep one copy for the
// whole program, perhaps the one with instructions that the machine lacks.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/voxel/cpu/cpu_isa.h"

namespace voxeld {

// A tile in words of 4x4x4 cells, both words and the bits in them in Morton order: bit b of word w
// is the cell whose Morton index in the tile is 64 w + b. The same bytes as TileDevice::read_mask
// on little-endian machines; 8 words are a brick, 4096 a block of 64^3 cells.
inline constexpr size_t kTileWords = size_t{256} * 256 * 256 / 64;
inline constexpr size_t kBrickWords64 = 8;
inline constexpr size_t kBlockBricks = 512;
inline constexpr size_t kBlockWords = kBlockBricks * kBrickWords64;

// What a kernel writes to: the tile in words of Morton order, then once more in words of rows
// (row_words.h); a cell is set where either says so. Then words that lanes without work write to,
// and the blocks whose Morton words may not be 0.
inline constexpr size_t kTouchRowsAt = kTileWords;
inline constexpr int32_t kUnusedRow = int32_t{kTileWords};  // from the first row
inline constexpr size_t kMortonBlocksAt = 2 * kTileWords + 16;
inline constexpr size_t kTouchWords = kMortonBlocksAt + 1;

struct TouchInput {
  const int32_t* vertices = nullptr;    // q, 3 per vertex
  const uint32_t* triangles = nullptr;  // 3 numbers of vertices each
  size_t triangle_stride = 3;           // in words of 32 bits
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
  // Sets the bits of all touched cells in kTouchWords words. Returns the blocks of 64^3 cells (bit
  // = Morton index) that it may have written to.
  uint64_t (*touch)(const TouchInput& input, uint64_t* words);
  // The same by rule=thin and rule=center; the blocks are those of all touched cells.
  uint64_t (*thin)(const TouchInput& input, uint64_t* words);
  uint64_t (*center)(const TouchInput& input, uint64_t* words);
  // Joins block number `block` of several tiles of kTouchWords words, keeps the bricks that are not
  // empty, and zeroes the block in all of them.
  void (*compact)(uint64_t* const* tiles, size_t tile_count, size_t block, CompactedBlock* out);
  // Joins it into the same block of `mask`, whose words have 32 bits and Morton order, and zeroes
  // it in `tiles`.
  void (*join)(uint64_t* const* tiles, size_t tile_count, size_t block, uint32_t* mask);
};

extern const TouchKernel kTouchKernelPortable;
#if defined(__x86_64__)
extern const TouchKernel kTouchKernelSse4;
extern const TouchKernel kTouchKernelAvx2;
extern const TouchKernel kTouchKernelAvx512;
#endif

// CHECKs that it is supported.
const TouchKernel& touch_kernel(CpuIsa isa);

}  // namespace voxeld
