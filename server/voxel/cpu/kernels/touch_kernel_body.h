// The kernel of one instruction set: it sorts a tile's triangles into batches of similar boxes and
// runs them. Included once by each touch_kernel_….cpp.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/base/simd/lanes.h"
#include "server/voxel/cpu/kernels/lines_kernel.h"
#include "server/voxel/cpu/kernels/morton_runs.h"
#include "server/voxel/cpu/kernels/row_words.h"
#include "server/voxel/cpu/kernels/touch_kernel.h"
#include "server/voxel/cpu/kernels/touch_large.h"
#include "server/voxel/cpu/kernels/touch_small.h"

namespace voxeld {
namespace {

// Class of a box by its size. Boxes of one class share batches, so that the lanes of a batch run a
// similar number of rows.
constexpr uint8_t kSizeClass[kSmallCells + 1] = {0, 0, 1, 2, 3, 4, 4, 5, 5,
                                                 6, 6, 7, 7, 7, 8, 8, 8, 8};
constexpr int kSizeClasses = 9;

class TileToucher {
 public:
  TileToucher(const TouchInput& input, uint64_t* words) : input_(input), words_(words) {}

  // Processes a group of triangles at a time, one per lane. The last group repeats its last
  // triangle, which does no harm.
  uint64_t run() {
    for (size_t i = 0; i < input_.list_count; i += kLanes) sort_group(i);
    flush();
    words_[kMortonBlocksAt] = morton_blocks_;
    uint64_t blocks = morton_blocks_;
    for (uint32_t block = 0; block < 64; ++block) {
      blocks |= uint64_t{seen_blocks_[block]} << block;
    }
    return blocks;
  }

 private:
  // The boxes of a group's lanes. Masks are -1 or 0 in a lane.
  struct Group {
    Int4 q[3][kLanes];
    IntLanes first[3], last[3];  // cells of the boxes inside the tile
    IntLanes inside;             // at least one cell is inside the tile
    IntLanes large;
    IntLanes row;  // the box is a row of cells, and each cell of it holds a part of the triangle
  };

  void sort_group(size_t first) {
    Group group;
    load(first, group);
    measure(group);
    const IntLanes small = group.inside & ~group.large;
    mark_blocks(group, small);
    fill_rows(group, small & group.row);
    touch_large(group, group.inside & group.large);
    add_to_batches(group, small & ~group.row);
  }

  void load(size_t first, Group& group) const {
    const Int4 tile_q = {input_.tile_q[0], input_.tile_q[1], input_.tile_q[2], 0};
    for (size_t lane = 0; lane < kLanes; ++lane) {
      const size_t i = first + lane < input_.list_count ? first + lane : input_.list_count - 1;
      const uint32_t* triangle = input_.triangles + input_.list[i] * input_.triangle_stride;
      for (int v = 0; v < 3; ++v) group.q[v][lane] = corner_of(input_, triangle[v]) - tile_q;
    }
  }

  void measure(Group& group) const {
    IntLanes p[3][3], one_cell{}, outside{};
    for (int v = 0; v < 3; ++v) transposed(group.q[v], p[v]);
    group.large = IntLanes{};
    for (int c = 0; c < 3; ++c) {
      const IntLanes low = lesser(p[0][c], lesser(p[1][c], p[2][c]));
      const IntLanes high = greater(p[0][c], greater(p[1][c], p[2][c]));
      group.first[c] = greater(low >> 8, IntLanes{});
      group.last[c] = lesser(high >> 8, all_lanes(input_.cell_last[c]));
      outside |= group.last[c] - group.first[c];
      group.large |= kSmallExtent - (high - low);
      one_cell += (low >> 8) == (high >> 8);
    }
    group.inside = ~(outside >> 31);
    group.large >>= 31;
    group.row = one_cell <= -2;
  }

  // Marks the blocks of small triangles' boxes; some of them may stay empty.
  void mark_blocks(const Group& group, IntLanes small) {
    const IntLanes first = block_number(group.first), last = block_number(group.last);
    const IntLanes number = small ? first : all_lanes(kNoBlock);
    for (int lane = 0; lane < kLanes; ++lane) seen_blocks_[number[lane]] = 1;
    uint32_t several = negative_lanes(small & (first != last));
    for (; several != 0; several &= several - 1) {
      const int lane = __builtin_ctz(several);
      mark_blocks_of_box(group, lane);
    }
  }

  static IntLanes block_number(const IntLanes (&cell)[3]) {
    return (row_word_x(cell[0]) | row_word_y(cell[1]) | row_word_z(cell[2])) >> 12;
  }

  void mark_blocks_of_box(const Group& group, int lane) {
    uint64_t blocks = blocks_of(corner(group.first, lane), corner(group.last, lane));
    for (; blocks != 0; blocks &= blocks - 1) seen_blocks_[__builtin_ctzll(blocks)] = 1;
  }

  static Int4 corner(const IntLanes (&cell)[3], int lane) {
    return Int4{cell[0][lane], cell[1][lane], cell[2][lane], 0};
  }

  void fill_rows(const Group& group, IntLanes wanted) {
    IntLanes y = group.first[1], z = group.first[2];
    while (negative_lanes(wanted) != 0) {
      set_rows(words_ + kTouchRowsAt, row_word_y(y) + row_word_z(z), group.first[0],
               group.last[0] + 1, wanted);
      // At most one of the two advances, because the box is a row.
      const IntLanes more_y = y < group.last[1], more_z = z < group.last[2];
      y -= more_y;
      z -= more_z;
      wanted &= more_y | more_z;
    }
  }

  void touch_large(const Group& group, IntLanes wanted) {
    for (uint32_t lanes = negative_lanes(wanted); lanes != 0; lanes &= lanes - 1) {
      const int lane = __builtin_ctz(lanes);
      Corners corners;
      for (int v = 0; v < 3; ++v) {
        for (int axis = 0; axis < 3; ++axis) corners.q[v][axis] = group.q[v][lane][axis];
      }
      morton_blocks_ |= LargeTriangle(corners, input_.cell_last).touch(words_);
    }
  }

  void add_to_batches(const Group& group, IntLanes wanted) {
    alignas(64) int32_t rows_y[kLanes], rows_z[kLanes];
    const IntLanes all_y = group.last[1] - group.first[1] + 1,
                   all_z = group.last[2] - group.first[2] + 1;
    __builtin_memcpy(rows_y, &all_y, sizeof rows_y);
    __builtin_memcpy(rows_z, &all_z, sizeof rows_z);
    for (uint32_t lanes = negative_lanes(wanted); lanes != 0; lanes &= lanes - 1) {
      const int lane = __builtin_ctz(lanes);
      SmallBatch& batch = batches_[kSizeClass[rows_z[lane]]][kSizeClass[rows_y[lane]]];
      const int place = batch.count++;
      for (int v = 0; v < 3; ++v) batch.q[v][place] = group.q[v][lane];
      if (batch.count == kLanes) run_batch(batch);
    }
  }

  void run_batch(SmallBatch& batch) {
    SmallTriangles(batch, input_.cell_last).touch(words_ + kTouchRowsAt);
    batch.count = 0;
  }

  // Runs the remaining triangles, merging batches of neighbouring sizes.
  void flush() {
    SmallBatch rest;
    for (auto& row : batches_) {
      for (SmallBatch& batch : row) {
        for (int lane = 0; lane < batch.count; ++lane) {
          copy_lane(batch, lane, rest, rest.count++);
          if (rest.count == kLanes) run_batch(rest);
        }
      }
    }
    if (rest.count == 0) return;
    // Unused lanes repeat a triangle, which does no harm.
    for (int lane = rest.count; lane < kLanes; ++lane) copy_lane(rest, 0, rest, lane);
    run_batch(rest);
  }

  static void copy_lane(const SmallBatch& from, int from_lane, SmallBatch& to, int to_lane) {
    for (int i = 0; i < 3; ++i) to.q[i][to_lane] = from.q[i][from_lane];
  }

  const TouchInput& input_;
  uint64_t* words_;
  static constexpr int32_t kNoBlock = 64;
  uint64_t morton_blocks_ = 0;
  uint8_t seen_blocks_[kNoBlock + 1] = {};          // 1 if a small triangle's box reaches the block
  SmallBatch batches_[kSizeClasses][kSizeClasses];  // by rows in z, in y
};

inline uint64_t touch(const TouchInput& input, uint64_t* words) {
  return TileToucher(input, words).run();
}

// Joins one block of all tiles into the first tile's and zeroes it in the others. Returns true if
// its Morton words may be nonzero.
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

// Takes the bricks of a block out of a tile in Morton order and zeroes the block. Calls
// visit(number, its 8 words) for every brick, empty ones included.
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
