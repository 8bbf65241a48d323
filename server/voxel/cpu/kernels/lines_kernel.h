// rule=thin and rule=center for one instruction set: the cells where lines through cells' centres
// meet triangles, along all axes or the dominant one. A tile's triangles are sorted into batches of
// similar boxes, once for each axis along which they can meet a line. Included once by each
// touch_kernel_….cpp.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/base/simd/lanes.h"
#include "server/voxel/cpu/kernels/lines_edge_on.h"
#include "server/voxel/cpu/kernels/lines_large.h"
#include "server/voxel/cpu/kernels/lines_small.h"
#include "server/voxel/cpu/kernels/morton_runs.h"
#include "server/voxel/cpu/kernels/touch_kernel.h"

namespace voxeld {
namespace {

inline Int4 corner_of(const TouchInput& input, uint32_t vertex) {
  const int32_t* q = input.vertices + size_t{3} * vertex;
  int64_t xy;
  __builtin_memcpy(&xy, q, sizeof xy);
  using Long2 = int64_t __attribute__((vector_size(16)));
  return reinterpret_cast<Int4>(Long2{xy, static_cast<uint32_t>(q[2])});
}

// Class of a box by its columns. Boxes of one class share batches, so that the lanes of a batch run
// a similar number of columns.
constexpr uint8_t kLineClass[kSmallColumns + 1] = {0, 0, 1, 2, 2, 3, 3, 3, 3,
                                                   4, 4, 4, 4, 4, 4, 4, 4};
constexpr int kLineClasses = 5;

// The axis in which the normal is largest, z before x before y; -1 if there is no area.
inline int dominant_axis(int64_t x, int64_t y, int64_t z) {
  x = x < 0 ? -x : x;
  y = y < 0 ? -y : y;
  z = z < 0 ? -z : z;
  if ((x | y | z) == 0) return -1;
  return z >= x && z >= y ? 2 : x >= y ? 0 : 1;
}

inline int dominant_axis(Int4 a, Int4 b, Int4 c) {
  const Int4 d = b - a, e = c - a;
  const auto normal = [&](int x, int y) { return int64_t{d[x]} * e[y] - int64_t{d[y]} * e[x]; };
  return dominant_axis(normal(1, 2), normal(2, 0), normal(0, 1));
}

template <bool kCenter>
class TileLines {
 public:
  TileLines(const TouchInput& input, uint64_t* words) : input_(input), words_(words) {
    for (int axis = 0; axis < 3; ++axis) {
      for (int c = 0; c < 3; ++c) cell_last_[axis][c] = input.cell_last[(axis + 1 + c) % 3];
    }
  }

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
    for (int axis = 0; axis < 3; ++axis) flush(axis);
    words_[kMortonBlocksAt] = blocks_;
    return blocks_;
  }

 private:
  void add(Int4 a, Int4 b, Int4 c, Int4 cell_last) {
    const Int4 low = lesser(a, lesser(b, c)), high = greater(a, greater(b, c));
    const Int4 first = greater(low >> 8, Int4{}), last = lesser(high >> 8, cell_last);
    if (any_negative(last - first)) return;
    blocks_ |= blocks_of(first, last);
    // Number of columns along each axis whose centres are in the box.
    const Int4 columns =
        lesser((high - 128) >> 8, cell_last) - greater((low + 128) >> 8, Int4{}) + 1;
    const bool x = columns[0] > 0, y = columns[1] > 0, z = columns[2] > 0;
    // Axes along which columns have their centres in the box.
    uint32_t axes = (y && z ? 1u : 0u) | (z && x ? 2u : 0u) | (x && y ? 4u : 0u);
    if (axes == 0) return;
    if constexpr (kCenter) {
      const int axis = dominant_axis(a, b, c);
      axes &= axis < 0 ? 0u : 1u << axis;
    }
    const bool is_large = any_negative(kSmallExtent - (high - low));
    for (; axes != 0; axes &= axes - 1) {
      const int axis = __builtin_ctz(axes);
      if (is_large) {
        set_large(a, b, c, axis);
      } else {
        add_small(a, b, c, axis, columns);
      }
    }
  }

  void set_large(Int4 a, Int4 b, Int4 c, int axis) {
    TurnedCorners t;
    t.axis = axis;
    for (int i = 0; i < 3; ++i) {
      const int from = (axis + 1 + i) % 3;
      t.q[0][i] = a[from];
      t.q[1][i] = b[from];
      t.q[2][i] = c[from];
      t.cell_last[i] = cell_last_[axis][i];
    }
    LargeLines<kCenter>(t).set(words_);
  }

  void add_small(Int4 a, Int4 b, Int4 c, int axis, Int4 columns) {
    const int from[3] = {kNext[axis], kNext[axis + 1], axis};
    const int columns_i = columns[from[0]], columns_j = columns[from[1]];
    LineBatch& batch = batches_[axis][kLineClass[columns_j]][kLineClass[columns_i]];
    const int lane = batch.count++;
    for (int i = 0; i < 3; ++i) {
      batch.q[0][i][lane] = a[from[i]];
      batch.q[1][i][lane] = b[from[i]];
      batch.q[2][i][lane] = c[from[i]];
    }
    batch.columns_i = greater(batch.columns_i, columns_i);
    batch.columns_j = greater(batch.columns_j, columns_j);
    if (batch.count == kLanes) run_batch(batch, axis);
  }

  void run_batch(LineBatch& batch, int axis) {
    SmallLines<kCenter>(batch, axis, cell_last_[axis])
        .set(batch.columns_i, batch.columns_j, words_);
    batch.count = batch.columns_i = batch.columns_j = 0;
  }

  // Runs the remaining triangles, merging batches of neighbouring sizes.
  void flush(int axis) {
    LineBatch rest;
    for (auto& row : batches_[axis]) {
      for (LineBatch& batch : row) {
        rest.columns_i = greater(rest.columns_i, batch.columns_i);
        rest.columns_j = greater(rest.columns_j, batch.columns_j);
        for (int lane = 0; lane < batch.count; ++lane) {
          copy_lane(batch, lane, rest, rest.count++);
          if (rest.count < kLanes) continue;
          run_batch(rest, axis);
          rest.columns_i = batch.columns_i;
          rest.columns_j = batch.columns_j;
        }
      }
    }
    if (rest.count == 0) return;
    // Unused lanes repeat a triangle, which does no harm.
    for (int lane = rest.count; lane < kLanes; ++lane) copy_lane(rest, 0, rest, lane);
    run_batch(rest, axis);
  }

  static void copy_lane(const LineBatch& from, int from_lane, LineBatch& to, int to_lane) {
    for (int i = 0; i < 3; ++i) {
      for (int c = 0; c < 3; ++c) to.q[i][c][to_lane] = from.q[i][c][from_lane];
    }
  }

  static constexpr int kNext[4] = {1, 2, 0, 1};

  const TouchInput& input_;
  uint64_t* words_;
  uint64_t blocks_ = 0;
  int32_t cell_last_[3][3];  // by axis; rotated so that the axis is index 2
  LineBatch batches_[3][kLineClasses][kLineClasses];  // by axis, columns in j, in i
};

inline uint64_t thin(const TouchInput& input, uint64_t* words) {
  return TileLines<false>(input, words).run();
}
inline uint64_t center(const TouchInput& input, uint64_t* words) {
  return TileLines<true>(input, words).run();
}

}  // namespace
}  // namespace voxeld
