// A triangle of any size by the touch rule. It goes over rows of cells along the box's longest
// axis; lanes are adjacent rows. Exact for triangles as wide as the largest grid; see the bounds at
// each step.
//
// The overlap test is Schwarz & Seidel's (2010): the plane and three projections. A triangle and a
// row of cells (v, w) intersect in a convex set, so the touched cells are one run [begin, end)
// along u:
// - the row meets the triangle iff the projection to (v, w) meets the square (v, w), which gives a
//   range of v for each w;
// - edges projected to (u, v) bound the run for each v, those projected to (w, u) for each w;
// - both sides of the plane bound it for each row.
//
// A bound is `a i + r >= 0` with integers a, r. For a > 0, begin = ceil(-r / a); for a < 0, end =
// floor(r / -a) + 1. As -r - 1/2 is never a multiple of a, both are floor((-r - 1/2) / a) + 1. The
// quotient is at least 1 / |2a| away from where floor jumps, so floating-point quotients with a
// smaller error are exact after floor.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/base/simd/lanes.h"
#include "server/voxel/cpu/kernels/morton_runs.h"
#include "server/voxel/cpu/kernels/touch_kernel.h"

namespace voxeld {
namespace {

// q of the three corners, relative to the tile's min corner.
struct Corners {
  int32_t q[3][3];  // corner, axis
};

constexpr int kTileCells = 256;

// An edge in one projection, as a bound on i for each j: i >= or < floor(slope * j + offset).
//
// |a|, |b| <= 2050 * 256 < 2^20, |c| < 2^32, |j| <= 256: slope * j and offset are quotients by a of
// numbers < 2^33, so their sum errs by less than 2^-18 / |a|, far below 1 / |2a|.
struct WideBound {
  double slope = 0, offset = 0;
  int kind = 0;  // 1: begin, -1: end, 0: none, because the edge runs along i
};

// The bound of a i + b j + c >= 0.
inline WideBound bound_of(int64_t a, int64_t b, int64_t c) {
  WideBound bound;
  if (a == 0) return bound;
  const double inverse = 1.0 / static_cast<double>(a);
  bound.slope = -static_cast<double>(b) * inverse;
  bound.offset = 1.0 - (static_cast<double>(c) + 0.5) * inverse;
  bound.kind = a > 0 ? 1 : -1;
  return bound;
}

// The bound of an edge from (pi, pj) along (di, dj); cells count from 0. side: -1 if the projection
// is clockwise, else 0.
inline WideBound wide_bound(int64_t pi, int64_t pj, int64_t di, int64_t dj, int64_t side) {
  const int64_t a = side - (dj ^ side), b = (di ^ side) - side;
  const int64_t reach_i = (a >= 0 ? 512 : 0) - (2 * pi + 1);
  const int64_t reach_j = (b >= 0 ? 512 : 0) - (2 * pj + 1);
  return bound_of(a, b, (a * reach_i + b * reach_j) >> 9);
}

// Narrows [begin, end) by the bounds that `at` (a j or w) gives for i, not yet rounded down; 0 <= i
// < count.
inline void narrow(const WideBound* bounds, double at, double& begin, double& end) {
  for (int e = 0; e < 3; ++e) {
    const double t = bounds[e].slope * at + bounds[e].offset;
    if (bounds[e].kind > 0 && t > begin) begin = t;
    if (bounds[e].kind < 0 && t < end) end = t;
  }
}

class LargeTriangle {
 public:
  LargeTriangle(const Corners& corners, const int32_t* cell_last) {
    int32_t first[3], count[3];
    for (int c = 0; c < 3; ++c) {
      const int32_t *a = corners.q[0], *b = corners.q[1], *d = corners.q[2];
      const int32_t low = lesser(a[c], lesser(b[c], d[c])) >> 8;
      const int32_t high = greater(a[c], greater(b[c], d[c])) >> 8;
      first[c] = greater(low, 0);
      count[c] = lesser(high, cell_last[c]) - first[c] + 1;
    }
    order_axes(count);
    for (int c = 0; c < 3; ++c) {
      const int axis = axis_[c];
      first_[c] = first[axis];
      count_[c] = count[axis];
      for (int i = 0; i < 3; ++i) p_[i][c] = corners.q[i][axis] - 256 * first[axis];
    }
    set_up();
  }

  uint64_t touch(uint64_t* words) const {
    if (count_[0] <= 0 || count_[1] <= 0 || count_[2] <= 0) return 0;
    alignas(64) double begin_v[kTileCells + kDoubleLanes], end_v[kTileCells + kDoubleLanes];
    for (int v = 0; v < count_[1]; ++v) {
      begin_v[v] = 0;
      end_v[v] = count_[0];
      narrow(u_of_v_, v, begin_v[v], end_v[v]);
    }
    uint64_t blocks = 0;
    for (int w = 0; w < count_[2]; ++w) {
      double begin_u = 0, end_u = count_[0], first = 0, last = count_[1];
      narrow(u_of_w_, w, begin_u, end_u);
      narrow(v_of_w_, w, first, last);
      // Clamped before conversion, because bounds may be far outside the range of int.
      const int v_begin = static_cast<int>(lesser(first, double{kTileCells}));
      const int v_end = static_cast<int>(greater(last, 0.0));
      const uint32_t row_w = kSpread.at[first_[2] + w] << axis_[2];
      for (int v = v_begin; v < v_end; v += kDoubleLanes) {
        blocks |= touch_rows(words, v, lesser(v_end - v, kDoubleLanes), w, begin_v + v, end_v + v,
                             begin_u, end_u, row_w);
      }
    }
    return blocks;
  }

 private:
  // Chooses u as the longest side of the box, so that there are few rows, and w as the shortest, so
  // that lanes are well filled.
  void order_axes(const int32_t* count) {
    axis_[0] = count[0] >= count[1] && count[0] >= count[2] ? 0 : count[1] >= count[2] ? 1 : 2;
    const int a = (axis_[0] + 1) % 3, b = (axis_[0] + 2) % 3;
    axis_[1] = count[a] >= count[b] ? a : b;
    axis_[2] = count[a] >= count[b] ? b : a;
  }

  void set_up() {
    int64_t d[3][3], n[3];
    for (int i = 0; i < 3; ++i) {
      for (int c = 0; c < 3; ++c) d[i][c] = p_[(i + 1) % 3][c] - p_[i][c];
    }
    for (int c = 0; c < 3; ++c) {
      const int x = (c + 1) % 3, y = (c + 2) % 3;
      n[c] = d[0][x] * d[1][y] - d[0][y] * d[1][x];
    }
    const int64_t side_u = n[0] >> 63, side_v = n[1] >> 63, side_w = n[2] >> 63;
    for (int i = 0; i < 3; ++i) {
      u_of_v_[i] = wide_bound(p_[i][0], p_[i][1], d[i][0], d[i][1], side_w);
      v_of_w_[i] = wide_bound(p_[i][1], p_[i][2], d[i][1], d[i][2], side_u);
      // The projection to (w, u) is oriented like n.v; seen as (u, w) it is the other way around.
      u_of_w_[i] = wide_bound(p_[i][0], p_[i][2], d[i][0], d[i][2], ~side_v);
    }
    // A projection without area has no orientation. Any sign will do, as long as its three edges
    // agree.
    set_up_plane(n);
  }

  // |n| <= 2^38.1 and |p| < 2^20.1: sums stay below 2^61, the constants below 2^51.
  void set_up_plane(int64_t* n) {
    const int64_t flip = n[0] >> 63;
    int64_t above = 0, below = 0;
    for (int c = 0; c < 3; ++c) {
      n[c] = (n[c] ^ flip) - flip;
      const int64_t p = 2 * p_[0][c] + 1;
      above += n[c] * ((n[c] >= 0 ? 512 : 0) - p);
      below -= n[c] * ((n[c] <= 0 ? 512 : 0) - p);
    }
    above_ = static_cast<double>(above >> 9);
    below_ = static_cast<double>(below >> 9);
    normal_v_ = static_cast<double>(n[1]);
    normal_w_ = static_cast<double>(n[2]);
    if (n[0] == 0) {
      // The plane contains the direction u, so it does not bound the rows that meet the triangle.
      inverse_u_ = 0;
      begin_bias_ = 0;
      end_bias_ = kTileCells;
    } else {
      inverse_u_ = 1.0 / static_cast<double>(n[0]);
      begin_bias_ = 1.0 - 0.5 * inverse_u_;
      end_bias_ = 1.0 + 0.5 * inverse_u_;
    }
  }

  // Heights are integers below 2^53, so exact. A quotient t errs by t * 2^-51. For t <= 257 that is
  // far less than 2^-39 <= 1 / |2 n.u|; larger quotients are clamped by the edges' bounds.
  uint64_t touch_rows(uint64_t* words, int v, int row_count, int w, const double* begin_v,
                      const double* end_v, double begin_u, double end_u, uint32_t row_w) const {
    alignas(64) double begins[kDoubleLanes], ends[kDoubleLanes];
    DoubleLanes from_v, to_v, at_v{};
    __builtin_memcpy(&from_v, begin_v, sizeof from_v);
    __builtin_memcpy(&to_v, end_v, sizeof to_v);
    for (int l = 0; l < kDoubleLanes; ++l) at_v[l] = v + l;
    const DoubleLanes height = normal_v_ * at_v + all_lanes_d(normal_w_ * w);
    const DoubleLanes from_plane = begin_bias_ - (height + above_) * inverse_u_;
    const DoubleLanes to_plane = end_bias_ + (below_ - height) * inverse_u_;
    const DoubleLanes from = greater(greater(from_v, from_plane), all_lanes_d(begin_u));
    const DoubleLanes to = lesser(lesser(to_v, to_plane), all_lanes_d(end_u));
    __builtin_memcpy(begins, &from, sizeof from);
    __builtin_memcpy(ends, &to, sizeof to);
    uint64_t blocks = 0;
    for (int l = 0; l < row_count; ++l) {
      if (!(begins[l] < 1e6) || !(ends[l] > 0)) continue;
      const int begin = static_cast<int>(begins[l]), end = static_cast<int>(ends[l]);
      if (begin >= end) continue;
      const auto row = row_w | kSpread.at[first_[1] + v + l] << axis_[1];
      blocks |=
          set_run(words, static_cast<uint32_t>(axis_[0]), row,
                  static_cast<uint32_t>(first_[0] + begin), static_cast<uint32_t>(first_[0] + end));
    }
    return blocks;
  }

  // Index 0, 1, 2: u, v, w.
  int axis_[3];
  int32_t first_[3], count_[3];  // cells of the box inside the tile
  int64_t p_[3][3];              // corners relative to the first cell
  WideBound u_of_v_[3], v_of_w_[3], u_of_w_[3];
  double normal_v_, normal_w_, above_, below_, inverse_u_, begin_bias_, end_bias_;
};

}  // namespace
}  // namespace voxeld
