// Triangles at most 16 voxels wide, a batch at a time. Lanes are triangles; loops run over the rows
// of cells along x of their boxes. The method is that of touch_large.h, but with floats. For the
// plane floats are too coarse, so 32-bit integers decide at the candidate.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/base/simd/lanes.h"
#include "server/voxel/cpu/kernels/row_words.h"
#include "server/voxel/cpu/kernels/touch_kernel.h"

namespace voxeld {
namespace {

// The largest extent on each axis, in 1/256 voxel. Relative to the box's first cell, corners are
// then < 2^12 + 2^8 in size, and |normal| <= 2^24 on each axis.
constexpr int32_t kSmallExtent = 4096;
// The most cells of a small triangle's box on each axis.
constexpr int kSmallCells = kSmallExtent / 256 + 1;

// Corners relative to the tile. Lanes from `count` on are not set.
struct alignas(64) SmallBatch {
  Int4 q[3][kLanes];
  int count = 0;
};

// Bounds of an edge, as in WideBound. With |a|, |b| <= 2^12, |j| <= 17, |c| < 2^18.1, slope * j +
// offset errs by less than 2^-24 * 4 * (2^16.1 + 2^18.1) / |a| < 2^-3.5 / |a|, and by 2^-19 for the
// + 1.
struct BoundLanes {
  FloatLanes slope, offset;
  IntLanes is_begin, is_end;
};

// The bounds of an edge; P = 2 p + 1 of its first corner.
inline BoundLanes bound_lanes(IntLanes P_i, IntLanes P_j, IntLanes di, IntLanes dj, IntLanes side) {
  const IntLanes a = side - (dj ^ side), b = negate_where(side, di);
  const IntLanes reach_i = (~(a >> 31) & 512) - P_i, reach_j = (~(b >> 31) & 512) - P_j;
  const IntLanes c = (a * reach_i + b * reach_j) >> 9;
  const FloatLanes inverse = 1.0f / to_float(a == 0 ? all_lanes(1) : a);
  BoundLanes bound;
  bound.slope = -to_float(b) * inverse;
  bound.offset = 1.0f - (to_float(c) + 0.5f) * inverse;
  bound.is_begin = a > 0;
  bound.is_end = a < 0;
  return bound;
}

inline void narrow(const BoundLanes* bounds, FloatLanes at, FloatLanes& begin, FloatLanes& end) {
  for (int e = 0; e < 3; ++e) {
    const FloatLanes t = bounds[e].slope * at + bounds[e].offset;
    begin = greater(
        begin, reinterpret_cast<FloatLanes>(reinterpret_cast<IntLanes>(t) & bounds[e].is_begin));
    end = lesser(end, bounds[e].is_end ? t : end);
  }
}

class SmallTriangles {
 public:
  SmallTriangles(const SmallBatch& batch, const int32_t* cell_last) {
    IntLanes p[3][3];
    for (int i = 0; i < 3; ++i) transposed(batch.q[i], p[i]);
    for (int c = 0; c < 3; ++c) {
      const IntLanes low = lesser(p[0][c], lesser(p[1][c], p[2][c])) >> 8;
      const IntLanes high = greater(p[0][c], greater(p[1][c], p[2][c])) >> 8;
      first_[c] = greater(low, IntLanes{});
      count_[c] = lesser(high, all_lanes(cell_last[c])) - first_[c] + 1;
      for (int i = 0; i < 3; ++i) p[i][c] -= first_[c] << 8;
    }
    set_up(p);
  }

  void touch(uint64_t* rows) const {
    const int rows_y = largest(count_[1]), rows_z = largest(count_[2]);
    FloatLanes begin_y[kSmallCells], end_y[kSmallCells];
    IntLanes row_y[kSmallCells];
    const FloatLanes count_x = to_float(count_[0]);
    for (int y = 0; y < rows_y; ++y) {
      begin_y[y] = FloatLanes{};
      end_y[y] = count_x;
      narrow(x_of_y_, all_lanes_f(static_cast<float>(y)), begin_y[y], end_y[y]);
      row_y[y] = row_word_y(first_[1] + y);
    }
    for (int z = 0; z < rows_z; ++z) {
      const FloatLanes at = all_lanes_f(static_cast<float>(z));
      FloatLanes begin_z{}, end_z = count_x, first{}, last = to_float(count_[1]);
      narrow(x_of_z_, at, begin_z, end_z);
      narrow(y_of_z_, at, first, last);
      const IntLanes y_begin = truncated(first);
      const IntLanes y_end = truncated(last) & (z < count_[2]);
      const IntLanes row_z = row_word_z(first_[2] + z);
      IntLanes height = normal_z_ * z + plane_;
      for (int y = 0; y < rows_y; ++y, height += normal_y_) {
        // Negative if y_begin <= y < y_end.
        const IntLanes in_row = (y_begin - y - 1) & (y - y_end);
        if (negative_lanes(in_row) == 0) continue;
        const FloatLanes begin = greater(begin_y[y], begin_z), end = lesser(end_y[y], end_z);
        touch_row(height, begin, end, in_row, row_y[y] + row_z, rows);
      }
    }
  }

 private:
  void set_up(const IntLanes (&p)[3][3]) {
    IntLanes d[3][3], P[3][3], n[3];
    for (int i = 0; i < 3; ++i) {
      for (int c = 0; c < 3; ++c) {
        d[i][c] = p[(i + 1) % 3][c] - p[i][c];
        P[i][c] = p[i][c] + p[i][c] + 1;
      }
    }
    for (int c = 0; c < 3; ++c) {
      const int x = (c + 1) % 3, y = (c + 2) % 3;
      n[c] = d[0][x] * d[1][y] - d[0][y] * d[1][x];
    }
    const IntLanes side_x = n[0] >> 31, side_y = n[1] >> 31, side_z = n[2] >> 31;
    for (int i = 0; i < 3; ++i) {
      x_of_y_[i] = bound_lanes(P[i][0], P[i][1], d[i][0], d[i][1], side_z);
      y_of_z_[i] = bound_lanes(P[i][1], P[i][2], d[i][1], d[i][2], side_x);
      x_of_z_[i] = bound_lanes(P[i][0], P[i][2], d[i][0], d[i][2], ~side_y);
    }
    set_up_plane(p[0], n);
  }

  // height = n.y y + n.z z + plane. With n.x >= 0 a cell is met iff n.x x + height + above >= 0 and
  // n.x x + height - below <= 0. The sum of all terms in a box is below 2^31: the box and one cell
  // around it are 18 cells wide, and |n| sums to at most 3 * 2^24.
  void set_up_plane(const IntLanes (&p)[3], IntLanes (&n)[3]) {
    const IntLanes flip = n[0] >> 31;
    IntLanes reach_high{}, reach_low{}, size{};
    plane_ = IntLanes{};
    for (int c = 0; c < 3; ++c) {
      n[c] = negate_where(flip, n[c]);
      const IntLanes sign = n[c] >> 31, magnitude = negate_where(sign, n[c]);
      // 512 times the distance from the corner to the side of its cell that is farthest along n.
      const IntLanes reach = negate_where(sign, 255 - 2 * (p[c] & 255)) + 256;
      // magnitude * reach has 33 bits, so the sum is kept as 512 * high + low.
      reach_high += (magnitude >> 9) * reach;
      reach_low += (magnitude & 511) * reach;
      size += magnitude;
      plane_ -= n[c] * (p[c] >> 8);
    }
    above_ = reach_high + (reach_low >> 9);
    // The distance from the corner to the other side is 512 - reach.
    below_ = size - reach_high - ((reach_low + 511) >> 9);
    normal_x_ = n[0];
    normal_y_ = n[1];
    normal_z_ = n[2];
    const IntLanes no_x = n[0] == 0;
    inverse_x_ = no_x ? FloatLanes{} : 1.0f / to_float(n[0]);
    // A plane that contains the direction x does not bound rows that meet the triangle.
    end_bias_ = no_x ? all_lanes_f(2 * kSmallCells) : all_lanes_f(1.0f + kMargin);
  }

  // Quotients that matter are at most 18 and err by 2^-18. With the margin the candidate is the
  // right cell or the one outside of it; the integer test decides.
  void touch_row(IntLanes height, FloatLanes begin, FloatLanes end, IntLanes in_row, IntLanes row,
                 uint64_t* rows) const {
    const IntLanes s_above = height + above_, s_below = height - below_;
    const FloatLanes from_plane = (1.0f - kMargin) - to_float(s_above) * inverse_x_;
    const FloatLanes to_plane = end_bias_ - to_float(s_below) * inverse_x_;
    begin = lesser(greater(begin, from_plane), all_lanes_f(2 * kSmallCells));
    end = greater(lesser(end, to_plane), FloatLanes{});
    IntLanes x_begin = truncated(begin), x_end = truncated(end);
    // The shifts give -1: the first moves begin up if the candidate is below the plane, the second
    // moves end down if it is above.
    x_begin -= (normal_x_ * x_begin + s_above) >> 31;
    x_end += (normal_x_ * (1 - x_end) - s_below) >> 31;
    const IntLanes wanted = (in_row & (x_begin - x_end)) >> 31;
    if (negative_lanes(wanted) == 0) return;
    set_rows(rows, row, x_begin + first_[0], x_end + first_[0], wanted);
  }

  static constexpr float kMargin = 1.0f / 512;

  IntLanes first_[3], count_[3];  // cells of the box inside the tile
  BoundLanes x_of_y_[3], y_of_z_[3], x_of_z_[3];
  IntLanes normal_x_, normal_y_, normal_z_, plane_, above_, below_;
  FloatLanes inverse_x_, end_bias_;
};

}  // namespace
}  // namespace voxeld
