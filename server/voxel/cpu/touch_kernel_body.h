// The kernel of one instruction set: sorts a tile's triangles into batches of alike boxes and runs
// them. Included once by each touch_kernel_….cpp.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/voxel/cpu/lanes.h"
#include "server/voxel/cpu/lines_kernel.h"
#include "server/voxel/cpu/morton_runs.h"
#include "server/voxel/cpu/row_words.h"
#include "server/voxel/cpu/touch_kernel.h"
#include "server/voxel/cpu/touch_large.h"
#include "server/voxel/cpu/touch_small.h"

namespace voxeld {
namespace {

// Sizes of boxes that share batches, so that the lanes of a batch run about as many rows.
constexpr uint8_t kSizeClass[kSmallCells + 1] = {0, 0, 1, 2, 3, 4, 4, 5, 5,
                                                 6, 6, 7, 7, 7, 8, 8, 8, 8};
constexpr int kSizeClasses = 9;

class TileToucher {
 public:
  TileToucher(const TouchInput& input, uint64_t* words) : input_(input), words_(words) {}

  uint64_t run() {
    const Int4 tile_q = {input_.tile_q[0], input_.tile_q[1], input_.tile_q[2], 0};
    const Int4 cell_last = {input_.cell_last[0], input_.cell_last[1], input_.cell_last[2], 0};
    for (size_t i = 0; i < input_.list_count; ++i) {
      const uint32_t* triangle = input_.triangles + input_.list[i] * input_.triangle_stride;
      const Int4 a = corner_of(input_, triangle[0]) - tile_q;
      const Int4 b = corner_of(input_, triangle[1]) - tile_q;
      const Int4 c = corner_of(input_, triangle[2]) - tile_q;
      add(a, b, c, cell_last);
    }
    flush();
    words_[kMortonBlocksAt] = morton_blocks_;
    return blocks_ | morton_blocks_;
  }

 private:
  void add(Int4 a, Int4 b, Int4 c, Int4 cell_last) {
    const Int4 low = lesser(a, lesser(b, c)), high = greater(a, greater(b, c));
    const Int4 first = greater(low >> 8, Int4{}), last = lesser(high >> 8, cell_last);
    if (any_negative(last - first)) return;
    if (any_negative(kSmallExtent - (high - low))) {
      Corners corners;
      for (int axis = 0; axis < 3; ++axis) {
        corners.q[0][axis] = a[axis];
        corners.q[1][axis] = b[axis];
        corners.q[2][axis] = c[axis];
      }
      morton_blocks_ |= LargeTriangle(corners, input_.cell_last).touch(words_);
      return;
    }
    blocks_ |= blocks_of(first, last);  // some may stay empty
    const Int4 cells = (high >> 8) - (low >> 8);
    // A box that is a row of cells: every slice of it holds a part of the triangle.
    if ((cells[0] == 0) + (cells[1] == 0) + (cells[2] == 0) >= 2) return fill_row(first, last);
    const int rows_y = last[1] - first[1] + 1, rows_z = last[2] - first[2] + 1;
    SmallBatch& batch = batches_[kSizeClass[rows_z]][kSizeClass[rows_y]];
    const int lane = batch.count++;
    batch.q[0][lane] = a;
    batch.q[1][lane] = b;
    batch.q[2][lane] = c;
    batch.rows_y = greater(batch.rows_y, rows_y);
    batch.rows_z = greater(batch.rows_z, rows_z);
    if (batch.count == kLanes) run_batch(batch);
  }

  void fill_row(Int4 first, Int4 last) {
    for (int z = first[2]; z <= last[2]; ++z) {
      for (int y = first[1]; y <= last[1]; ++y) {
        set_row(words_ + kTouchRowsAt, static_cast<uint32_t>(row_word_y(y) + row_word_z(z)),
                static_cast<uint32_t>(first[0]), static_cast<uint32_t>(last[0] + 1));
      }
    }
  }

  void run_batch(SmallBatch& batch) {
    SmallTriangles(batch, input_.cell_last)
        .touch(batch.rows_y, batch.rows_z, words_ + kTouchRowsAt);
    batch.count = batch.rows_y = batch.rows_z = 0;
  }

  // Runs what is left, neighbouring sizes together.
  void flush() {
    SmallBatch rest;
    for (auto& row : batches_) {
      for (SmallBatch& batch : row) {
        rest.rows_y = greater(rest.rows_y, batch.rows_y);
        rest.rows_z = greater(rest.rows_z, batch.rows_z);
        for (int lane = 0; lane < batch.count; ++lane) {
          copy_lane(batch, lane, rest, rest.count++);
          if (rest.count < kLanes) continue;
          run_batch(rest);
          rest.rows_y = batch.rows_y;
          rest.rows_z = batch.rows_z;
        }
      }
    }
    if (rest.count == 0) return;
    // A triangle once more does no harm.
    for (int lane = rest.count; lane < kLanes; ++lane) copy_lane(rest, 0, rest, lane);
    run_batch(rest);
  }

  static void copy_lane(const SmallBatch& from, int from_lane, SmallBatch& to, int to_lane) {
    for (int i = 0; i < 3; ++i) to.q[i][to_lane] = from.q[i][from_lane];
  }

  const TouchInput& input_;
  uint64_t* words_;
  uint64_t blocks_ = 0, morton_blocks_ = 0;
  SmallBatch batches_[kSizeClasses][kSizeClasses];  // by rows in z, in y
};

inline uint64_t touch(const TouchInput& input, uint64_t* words) {
  return TileToucher(input, words).run();
}

// Joins one block of all tiles into the first one's, and zeroes it in the others. Returns whether
// its Morton words may not be 0.
inline bool join_block(uint64_t* const* tiles, size_t tile_count, size_t block) {
  const size_t first = block * kBlockWords;
  bool in_morton = (tiles[0][kMortonBlocksAt] >> block & 1) != 0;
  for (size_t t = 1; t < tile_count; ++t) {
    for (size_t w = kTouchRowsAt + first; w < kTouchRowsAt + first + kBlockWords; ++w) {
      tiles[0][w] |= tiles[t][w];
      tiles[t][w] = 0;
    }
    if ((tiles[t][kMortonBlocksAt] >> block & 1) == 0) continue;
    in_morton = true;
    for (size_t w = first; w < first + kBlockWords; ++w) {
      tiles[0][w] |= tiles[t][w];
      tiles[t][w] = 0;
    }
  }
  return in_morton;
}

// Takes the bricks of a block out of a tile, in Morton order: visit(number, its 8 words), for all
// of them, also empty ones. Zeroes the block.
template <typename Visit>
void take_bricks(uint64_t* words, size_t block, bool in_morton, const Visit& visit) {
  uint64_t* morton = words + block * kBlockWords;
  uint64_t* rows = morton + kTouchRowsAt;
  uint64_t any[64];
  for (int i = 0; i < 64; ++i) any[i] = any_in_bricks(rows, i & 7, i >> 3);
  for (uint32_t i = 0; i < kBlockBricks; ++i) {
    uint64_t brick[kBrickWords64] = {};
    const int bx = static_cast<int>(compact3(i)), by = static_cast<int>(compact3(i >> 1)),
              bz = static_cast<int>(compact3(i >> 2));
    if (in_morton) __builtin_memcpy(brick, morton + i * kBrickWords64, sizeof brick);
    if ((any[by + 8 * bz] >> 8 * bx & 0xff) != 0) add_brick_of_rows(rows, bx, by, bz, brick);
    visit(static_cast<uint32_t>(block * kBlockBricks) + i, brick);
  }
  __builtin_memset(rows, 0, kBlockWords * sizeof *rows);
  if (in_morton) __builtin_memset(morton, 0, kBlockWords * sizeof *morton);
}

inline void compact(uint64_t* const* tiles, size_t tile_count, size_t block, CompactedBlock* out) {
  size_t count = 0;
  uint64_t voxels = 0;
  const bool in_morton = join_block(tiles, tile_count, block);
  take_bricks(tiles[0], block, in_morton, [&](uint32_t number, const uint64_t* brick) {
    uint64_t any = 0;
    for (size_t w = 0; w < kBrickWords64; ++w) any |= brick[w];
    if (any == 0) return;
    out->brick_morton[count] = number;
    for (size_t w = 0; w < kBrickWords64; ++w) {
      out->masks[count][w] = brick[w];
      voxels += static_cast<uint64_t>(__builtin_popcountll(brick[w]));
    }
    ++count;
  });
  out->brick_count = count;
  out->voxel_count = voxels;
}

inline void join(uint64_t* const* tiles, size_t tile_count, size_t block, uint32_t* mask) {
  const bool in_morton = join_block(tiles, tile_count, block);
  take_bricks(tiles[0], block, in_morton, [&](uint32_t number, const uint64_t* brick) {
    __builtin_memcpy(mask + size_t{number} * 2 * kBrickWords64, brick,
                     kBrickWords64 * sizeof *brick);
  });
}

}  // namespace
}  // namespace voxeld
