// The kernel of one instruction set: sorts a tile's triangles into batches of alike boxes and runs
// them. Included once by each touch_kernel_….cpp.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/voxel/cpu/lanes.h"
#include "server/voxel/cpu/morton_runs.h"
#include "server/voxel/cpu/touch_kernel.h"
#include "server/voxel/cpu/touch_large.h"
#include "server/voxel/cpu/touch_small.h"

namespace voxeld {
namespace {

// Sizes of boxes that share batches, so that the lanes of a batch run about as many rows.
constexpr uint8_t kSizeClass[kSmallCells + 1] = {0, 0, 1, 2, 3, 4, 4, 5, 5,
                                                 6, 6, 7, 7, 7, 8, 8, 8, 8};
constexpr int kSizeClasses = 9;

inline Int4 corner_of(const TouchInput& input, uint32_t vertex) {
  const int32_t* q = input.vertices + size_t{3} * vertex;
  return Int4{q[0], q[1], q[2], 0};
}

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
    return blocks_;
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
      blocks_ |= LargeTriangle(corners, input_.cell_last).touch(words_);
      return;
    }
    mark_blocks(first, last);
    const Int4 cells = (high >> 8) - (low >> 8);
    // A box that is a row of cells: every slice of it holds a part of the triangle.
    if ((cells[0] == 0) + (cells[1] == 0) + (cells[2] == 0) >= 2) return fill_row(first, last);
    const int rows_y = last[1] - first[1] + 1, rows_z = last[2] - first[2] + 1;
    SmallBatch& batch = batches_[kSizeClass[rows_z]][kSizeClass[rows_y]];
    const int lane = batch.count++;
    for (int axis = 0; axis < 3; ++axis) {
      batch.q[0][axis][lane] = a[axis];
      batch.q[1][axis][lane] = b[axis];
      batch.q[2][axis][lane] = c[axis];
    }
    batch.rows_y = greater(batch.rows_y, rows_y);
    batch.rows_z = greater(batch.rows_z, rows_z);
    if (batch.count == kLanes) run_batch(batch);
  }

  // Of the box; some may stay empty.
  void mark_blocks(Int4 first, Int4 last) {
    first >>= 6;
    last >>= 6;
    for (int z = first[2]; z <= last[2]; ++z) {
      for (int y = first[1]; y <= last[1]; ++y) {
        for (int x = first[0]; x <= last[0]; ++x) {
          blocks_ |= uint64_t{1} << (kSpread.at[x] | kSpread.at[y] << 1 | kSpread.at[z] << 2);
        }
      }
    }
  }

  void fill_row(Int4 first, Int4 last) {
    for (int z = first[2]; z <= last[2]; ++z) {
      for (int y = first[1]; y <= last[1]; ++y) {
        set_short_run(words_, kSpread.at[y] << 1 | kSpread.at[z] << 2,
                      static_cast<uint32_t>(first[0]), static_cast<uint32_t>(last[0] + 1));
      }
    }
  }

  void run_batch(SmallBatch& batch) {
    SmallTriangles(batch, input_.cell_last).touch(batch.rows_y, batch.rows_z, words_);
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
    for (int i = 0; i < 3; ++i) {
      for (int c = 0; c < 3; ++c) to.q[i][c][to_lane] = from.q[i][c][from_lane];
    }
  }

  const TouchInput& input_;
  uint64_t* words_;
  uint64_t blocks_ = 0;
  SmallBatch batches_[kSizeClasses][kSizeClasses];  // by rows in z, in y
};

inline uint64_t touch(const TouchInput& input, uint64_t* words) {
  return TileToucher(input, words).run();
}

// Joins a brick of all tiles into `brick` and zeroes it in them. Returns whether any cell is set.
inline bool take_brick(uint64_t* const* tiles, size_t tile_count, size_t word, uint64_t* brick) {
  uint64_t any = 0;
  for (size_t w = 0; w < kBrickWords64; ++w) {
    brick[w] = tiles[0][word + w];
    any |= brick[w];
  }
  if (any != 0) {
    for (size_t w = 0; w < kBrickWords64; ++w) tiles[0][word + w] = 0;
  }
  for (size_t t = 1; t < tile_count; ++t) {
    uint64_t more = 0;
    for (size_t w = 0; w < kBrickWords64; ++w) {
      brick[w] |= tiles[t][word + w];
      more |= tiles[t][word + w];
    }
    if (more == 0) continue;
    any |= more;
    for (size_t w = 0; w < kBrickWords64; ++w) tiles[t][word + w] = 0;
  }
  return any != 0;
}

inline void compact(uint64_t* const* tiles, size_t tile_count, size_t block, CompactedBlock* out) {
  size_t count = 0;
  uint64_t voxels = 0;
  for (size_t i = 0; i < kBlockBricks; ++i) {
    const size_t brick = block * kBlockBricks + i;
    // Written even if it is empty: the next one then takes its place.
    uint64_t* mask = out->masks[count];
    if (!take_brick(tiles, tile_count, brick * kBrickWords64, mask)) continue;
    out->brick_morton[count++] = static_cast<uint32_t>(brick);
    for (size_t w = 0; w < kBrickWords64; ++w) {
      voxels += static_cast<uint64_t>(__builtin_popcountll(mask[w]));
    }
  }
  out->brick_count = count;
  out->voxel_count = voxels;
}

inline void join(uint64_t* const* tiles, size_t tile_count, size_t block, uint32_t* mask) {
  for (size_t i = 0; i < kBlockBricks; ++i) {
    const size_t word = (block * kBlockBricks + i) * kBrickWords64;
    uint64_t brick[kBrickWords64];
    take_brick(tiles, tile_count, word, brick);
    __builtin_memcpy(mask + 2 * word, brick, sizeof brick);
  }
}

}  // namespace
}  // namespace voxeld
