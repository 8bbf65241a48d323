// The cells where lines through cells' centres meet triangles at most 16 voxels wide, a batch at a
// time. Lanes are triangles, seen along one axis. Loops run over the columns of cells along it
// whose centres are in the triangle's box. All decisions are 32-bit integers.
//
// A column's centre is at (512 i + 256, 512 j + 256), corners are at P = 2 q + 1, in 1/512 voxel.
// - Inside: a (x - Px) + b (y - Py) >= 0 for each side, which divided by 512 and rounded down is
//   a i + b j + c >= 0 with c = floor((a (256 - Px) + b (256 - Py)) / 512).
// - Depth: the plane is not below the floor of cell k iff, with n.z > 0,
//   n.x (x - Px) + n.y (y - Py) + n.z (512 k - Pz) <= 0; divided by 512 and rounded up, iff
//   n.z k + height <= 0 with the integer height = n.x i + n.y j +
//   ceil((n.x (256 - Px) + n.y (256 - Py) - n.z Pz) / 512). So the cell is
//   k = floor(-height / n.z).
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/base/simd/lanes.h"
#include "server/voxel/cpu/kernels/lines_edge_on.h"
#include "server/voxel/cpu/kernels/morton_runs.h"
#include "server/voxel/cpu/kernels/touch_small.h"

namespace voxeld {
namespace {

// The most columns along an axis of a small triangle's box whose centres are inside.
constexpr int kSmallColumns = kSmallExtent / 256;

// Corners relative to the tile's min corner, rotated cyclically so that the axis of sight is index
// 2. Lanes from `count` on are not set.
struct alignas(64) LineBatch {
  int32_t q[3][3][kLanes];  // corner, axis
  int count = 0;
  int columns_i = 0, columns_j = 0;  // at least as many as any box of the batch has
};

// An edge as a i + b j + c >= 0 for columns whose centre is on the inner side. |a|, |b| <= 2^12 and
// |P| < 2^13.1, so 512 c is a sum below 2^27.
struct EdgeLanes {
  IntLanes a, b, c;
};

// kCenter: a centre on a side belongs to that one of the two triangles sharing it for which a > 0
// (top-left rule); otherwise to both. A side with a = 0 has no centres on it.
template <bool kCenter>
EdgeLanes edge_lanes(IntLanes P_i, IntLanes P_j, IntLanes di, IntLanes dj, IntLanes side) {
  EdgeLanes edge;
  edge.a = side - (dj ^ side);
  edge.b = negate_where(side, di);
  IntLanes sum = edge.a * (256 - P_i) + edge.b * (256 - P_j);
  if constexpr (kCenter) sum -= (edge.a <= 0) & 1;
  edge.c = sum >> 9;
  return edge;
}

template <bool kCenter>
class SmallLines {
 public:
  // cell_last: rotated like the corners. axis: the axis that became index 2.
  SmallLines(const LineBatch& batch, int axis, const int32_t* cell_last)
      : batch_(batch), axis_(axis), cell_last_(cell_last) {
    IntLanes p[3][3];
    for (int c = 0; c < 3; ++c) {
      for (int i = 0; i < 3; ++i) __builtin_memcpy(&p[i][c], batch.q[i][c], sizeof p[i][c]);
      const IntLanes low = lesser(p[0][c], lesser(p[1][c], p[2][c]));
      const IntLanes high = greater(p[0][c], greater(p[1][c], p[2][c]));
      // Depth counts from the box's first cell, which may lie outside the tile, so it is never
      // negative.
      first_[c] = c == 2 ? low >> 8 : greater((low + 128) >> 8, IntLanes{});
      count_[c] = lesser((high - 128) >> 8, all_lanes(cell_last[c])) - first_[c] + 1;
      for (int i = 0; i < 3; ++i) p[i][c] -= first_[c] << 8;
    }
    set_up(p);
  }

  void set(int columns_i, int columns_j, uint64_t* words) const {
    if constexpr (!kCenter) set_edge_on_lanes(words);
    IntLanes column_i[kSmallColumns];
    for (int i = 0; i < columns_i; ++i) {
      column_i[i] = spread8(first_[0] + i) << (axis_ + 1) % 3;
    }
    for (int j = 0; j < columns_j; ++j) {
      const IntLanes column_j = spread8(first_[1] + j) << (axis_ + 2) % 3;
      const IntLanes in_row = (count_[1] - 1 - j) | never_;
      IntLanes e0 = edges_[0].b * j + edges_[0].c, e1 = edges_[1].b * j + edges_[1].c,
               e2 = edges_[2].b * j + edges_[2].c, height = normal_[1] * j + constant_;
      for (int i = 0; i < columns_i; ++i) {
        const uint32_t lanes = negative_lanes(~(e0 | e1 | e2 | in_row | (count_[0] - 1 - i)));
        if (lanes != 0) set_cells(lanes, height, column_i[i] | column_j, words);
        e0 += edges_[0].a;
        e1 += edges_[1].a;
        e2 += edges_[2].a;
        height += normal_[0];
      }
    }
  }

 private:
  void set_up(const IntLanes (&p)[3][3]) {
    IntLanes d[3][3], P[3][3];
    for (int i = 0; i < 3; ++i) {
      for (int c = 0; c < 3; ++c) {
        d[i][c] = p[(i + 1) % 3][c] - p[i][c];
        P[i][c] = p[i][c] + p[i][c] + 1;
      }
    }
    for (int c = 0; c < 3; ++c) {
      const int x = (c + 1) % 3, y = (c + 2) % 3;
      normal_[c] = d[0][x] * d[1][y] - d[0][y] * d[1][x];
    }
    const IntLanes side = normal_[2] >> 31;
    for (int i = 0; i < 3; ++i) {
      edges_[i] = edge_lanes<kCenter>(P[i][0], P[i][1], d[i][0], d[i][1], side);
    }
    for (IntLanes& n : normal_) n = negate_where(side, n);
    never_ = normal_[2] == 0;
    inverse_ = 1.0f / to_float(never_ != 0 ? all_lanes(1) : normal_[2]);
    set_up_plane(p[0]);
  }

  // With |n| <= 2^24 and corners within 17 cells of the first one, heights are at most 18 * 2^24 if
  // a centre is inside; elsewhere they may wrap around. 512 times the constant has 35 bits, so it
  // is kept as 512 * high + low.
  void set_up_plane(const IntLanes (&p)[3]) {
    IntLanes high{}, low{};
    for (int c = 0; c < 3; ++c) {
      const IntLanes in_cell = 2 * (p[c] & 255) + 1;
      const IntLanes reach = c == 2 ? -in_cell : 256 - in_cell;
      high += (normal_[c] >> 9) * reach - normal_[c] * (p[c] >> 8);
      low += (normal_[c] & 511) * reach;
    }
    constant_ = high + ((low + 511) >> 9);
  }

  // Quotients are at most 18 and err by 2^-18, so the candidate is the right cell or the one above;
  // the integer test decides. Other lanes are clamped, so that they fit.
  void set_cells(uint32_t lanes, IntLanes height, IntLanes column, uint64_t* words) const {
    FloatLanes quotient = kMargin - to_float(height) * inverse_;
    quotient = greater(lesser(quotient, all_lanes_f(2 * kSmallCells)), FloatLanes{});
    IntLanes k = truncated(quotient);
    k -= (height + normal_[2] * k > 0) & 1;
    k += first_[2];
    lanes &= negative_lanes(~(k | (cell_last_[2] - k)));
    const IntLanes cell = column | spread8(k) << axis_;
    // Not memcpy, which GCC 12 compiles here to moves through general registers.
    alignas(64) int32_t cells[kLanes];
    *reinterpret_cast<IntLanes*>(cells) = cell;
    for (; lanes != 0; lanes &= lanes - 1) {
      const auto m = static_cast<uint32_t>(cells[__builtin_ctz(lanes)]);
      words[m >> 6] |= uint64_t{1} << (m & 63);
    }
  }

  void set_edge_on_lanes(uint64_t* words) const {
    for (uint32_t lanes = negative_lanes(never_); lanes != 0; lanes &= lanes - 1) {
      const int l = __builtin_ctz(lanes);
      TurnedCorners t;
      t.axis = axis_;
      for (int c = 0; c < 3; ++c) {
        t.cell_last[c] = cell_last_[c];
        for (int i = 0; i < 3; ++i) t.q[i][c] = batch_.q[i][c][l];
      }
      set_edge_on(t, words);
    }
  }

  static constexpr float kMargin = 1.0f / 512;

  const LineBatch& batch_;
  int axis_;
  const int32_t* cell_last_;
  IntLanes first_[3], count_[3];  // count_[2] is not used
  EdgeLanes edges_[3];
  IntLanes normal_[3], constant_;
  IntLanes never_;  // -1 if the triangle is seen edge-on
  FloatLanes inverse_;
};

}  // namespace
}  // namespace voxeld
