// The cells where lines through cells' centres meet a triangle of any size, seen along one axis.
// Rows of columns are handled one by one. The triangle's sides bound a run in each row, and the
// plane's depth is computed for a few columns at a time. lines_small.h says what is computed; here
// doubles compute it, exact as touch_large.h shows.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/base/simd/lanes.h"
#include "server/voxel/cpu/kernels/lines_edge_on.h"
#include "server/voxel/cpu/kernels/morton_runs.h"
#include "server/voxel/cpu/kernels/touch_large.h"

namespace voxeld {
namespace {

// As many lanes as DoubleLanes.
using HalfIntLanes = int32_t __attribute__((vector_size(VOXELD_LANE_BYTES / 2)));

// A side from (pi, pj) along (di, dj) as a bound on the centres of row j. side: -1 if the
// projection is clockwise, else 0. kCenter: see edge_lanes(). A side along the row bounds nothing,
// because the box ends there too.
template <bool kCenter>
WideBound centre_bound(int64_t pi, int64_t pj, int64_t di, int64_t dj, int64_t side) {
  const int64_t a = side - (dj ^ side), b = (di ^ side) - side;
  const int64_t sum =
      a * (255 - 2 * pi) + b * (255 - 2 * pj) - static_cast<int64_t>(kCenter && a <= 0);
  return bound_of(a, b, sum >> 9);
}

template <bool kCenter>
class LargeLines {
 public:
  explicit LargeLines(const TurnedCorners& corners) : corners_(corners) {
    for (int c = 0; c < 2; ++c) {
      const int64_t x = corners.q[0][c], y = corners.q[1][c], z = corners.q[2][c];
      const int64_t low = lesser(x, lesser(y, z)), high = greater(x, greater(y, z));
      first_[c] = static_cast<int>(greater((low + 128) >> 8, int64_t{0}));
      const int64_t last = lesser((high - 128) >> 8, int64_t{corners.cell_last[c]});
      count_[c] = static_cast<int>(greater(last, int64_t{-1})) - first_[c] + 1;
    }
  }

  void set(uint64_t* words) {
    if (count_[0] <= 0 || count_[1] <= 0) return;
    if (!set_up()) {
      if constexpr (!kCenter) set_edge_on(corners_, words);
      return;
    }
    for (int j = 0; j < count_[1]; ++j) {
      double begin = 0, end = count_[0];
      narrow(bounds_, j, begin, end);
      // Clamped before conversion, because bounds may be far outside the range of int.
      const int i_begin = static_cast<int>(lesser(begin, double{kTileCells}));
      const int i_end = static_cast<int>(greater(end, 0.0));
      if (i_begin < i_end) set_row(words, j, i_begin, i_end);
    }
  }

 private:
  // False if the triangle is seen edge-on. With |d| < 2^19.1, |n| <= 2^38.1 and |2 p + 1| < 2^21
  // the sum that becomes the constant stays below 2^61, heights below 2^53.
  bool set_up() {
    int64_t p[3][3], d[3][3], n[3];
    for (int i = 0; i < 3; ++i) {
      p[i][0] = corners_.q[i][0] - int64_t{256} * first_[0];
      p[i][1] = corners_.q[i][1] - int64_t{256} * first_[1];
      p[i][2] = corners_.q[i][2];
    }
    for (int i = 0; i < 3; ++i) {
      for (int c = 0; c < 3; ++c) d[i][c] = p[(i + 1) % 3][c] - p[i][c];
    }
    for (int c = 0; c < 3; ++c) {
      const int x = (c + 1) % 3, y = (c + 2) % 3;
      n[c] = d[0][x] * d[1][y] - d[0][y] * d[1][x];
    }
    if (n[2] == 0) return false;
    const int64_t side = n[2] >> 63;
    for (int i = 0; i < 3; ++i) {
      bounds_[i] = centre_bound<kCenter>(p[i][0], p[i][1], d[i][0], d[i][1], side);
    }
    for (int64_t& c : n) c = (c ^ side) - side;
    const int64_t sum =
        n[0] * (255 - 2 * p[0][0]) + n[1] * (255 - 2 * p[0][1]) - n[2] * (2 * p[0][2] + 1);
    constant_ = static_cast<double>((sum + 511) >> 9);
    slope_i_ = static_cast<double>(n[0]);
    slope_j_ = static_cast<double>(n[1]);
    inverse_ = 1.0 / static_cast<double>(n[2]);
    is_flat_ = 8 * (n[0] < 0 ? -n[0] : n[0]) <= n[2];
    return true;
  }

  // Writes 1 + the cell of each column, clamped to 0 and kTileCells + 1. The cell is floor((1/2 -
  // height) / n.z). The quotient is at least 2^-39.1 away from an integer; for cells up to 257 its
  // error is below 2^-42.
  void find_depths(int32_t* depths, int j, int i_begin, int i_end) const {
    DoubleLanes at{};
    for (int l = 0; l < kDoubleLanes; ++l) at[l] = l;
    const DoubleLanes row = all_lanes_d(slope_j_ * j + constant_);
    for (int i = i_begin; i < i_end; i += kDoubleLanes) {
      const DoubleLanes height = slope_i_ * (at + all_lanes_d(i)) + row;
      DoubleLanes depth = 1.0 + (0.5 - height) * inverse_;
      depth = greater(lesser(depth, all_lanes_d(kTileCells + 1)), DoubleLanes{});
      const HalfIntLanes cells = __builtin_convertvector(depth, HalfIntLanes);
      __builtin_memcpy(depths + i, &cells, sizeof cells);
    }
  }

  void set_row(uint64_t* words, int j, int i_begin, int i_end) const {
    alignas(64) int32_t depths[kTileCells + kDoubleLanes];
    find_depths(depths, j, i_begin, i_end);
    const uint32_t row = kSpread.at[first_[1] + j] << (corners_.axis + 2) % 3;
    if (is_flat_) {
      set_runs(words, depths, row, i_begin, i_end);
    } else {
      set_cells(words, depths, row, i_begin, i_end);
    }
  }

  bool is_in_tile(int k) const { return k >= 0 && k <= corners_.cell_last[2]; }

  // Adjacent columns mostly have the same depth, so their cells form one run.
  void set_runs(uint64_t* words, const int32_t* depths, uint32_t row, int i_begin,
                int i_end) const {
    const auto axis_i = static_cast<uint32_t>((corners_.axis + 1) % 3);
    for (int i = i_begin; i < i_end;) {
      const int begin = i, k = depths[i] - 1;
      for (++i; i < i_end && depths[i] - 1 == k; ++i) {
      }
      if (!is_in_tile(k)) continue;
      set_run(words, axis_i, row | kSpread.at[k] << corners_.axis,
              static_cast<uint32_t>(first_[0] + begin), static_cast<uint32_t>(first_[0] + i));
    }
  }

  void set_cells(uint64_t* words, const int32_t* depths, uint32_t row, int i_begin,
                 int i_end) const {
    const int axis_i = (corners_.axis + 1) % 3, axis_k = corners_.axis;
    for (int i = i_begin; i < i_end; ++i) {
      const int k = depths[i] - 1;
      if (!is_in_tile(k)) continue;
      const uint32_t m = row | kSpread.at[first_[0] + i] << axis_i | kSpread.at[k] << axis_k;
      words[m >> 6] |= uint64_t{1} << (m & 63);
    }
  }

  const TurnedCorners& corners_;
  int first_[2], count_[2];  // columns of the box inside the tile, counted by centres
  WideBound bounds_[3];
  double slope_i_, slope_j_, constant_, inverse_;
  bool is_flat_;  // in i: runs of 8 cells or more have the same depth
};

}  // namespace
}  // namespace voxeld
