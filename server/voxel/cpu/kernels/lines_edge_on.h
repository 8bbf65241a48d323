// Triangles that are seen edge-on along an axis, for rule=thin, whatever their size. They share
// segments with the lines through cells' centres. ../README.md defines which cells are occupied.
//
// Seen edge-on, a triangle is a segment from one odd point (in 1/512 voxel) to another. Centres are
// even points, 256 more than multiples of 512. A centre (x, y) on the segment from (Px, Py) along
// (dx, dy) has (x - Px) dy = (y - Py) dx with x - Px and y - Py odd. So dx and dy have the same
// power of two, and neither is 0. Most edge-on triangles, and all faces of axis-aligned boxes, fail
// this test at once.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/base/simd/lanes.h"
#include "server/voxel/cpu/kernels/morton_runs.h"

namespace voxeld {
namespace {

// Corners of a triangle relative to the tile's min corner, rotated cyclically so that `axis` of the
// tile is index 2.
struct TurnedCorners {
  int64_t q[3][3];  // corner, axis
  int axis;
  int32_t cell_last[3];
};

// floor(a / b), b > 0.
inline int64_t floor_divided(int64_t a, int64_t b) {
  const int64_t quotient = a / b;
  return quotient - static_cast<int64_t>(a % b < 0);
}

// The cell along z that contains the edge from p to e at x, in 1/512 voxel. dx = ex - px must not
// be 0. Terms are below 2^21 * 2^21, and 512 dx is below 2^30.
inline int64_t edge_cell(const int64_t* p, const int64_t* e, int64_t x) {
  const int64_t sign = e[0] < p[0] ? -1 : 1;
  const int64_t dx = sign * (e[0] - p[0]), dz = sign * (e[2] - p[2]);
  return floor_divided((2 * p[2] + 1) * dx + dz * (x - (2 * p[0] + 1)), 512 * dx);
}

// Sets the cells along the line through the centre (i, j), which must meet the triangle.
inline void set_edge_on_line(const TurnedCorners& t, uint64_t* words, int64_t i, int64_t j) {
  const int64_t x = 512 * i + 256;
  int64_t first = INT64_MAX, last = INT64_MIN;
  for (int side = 0; side < 3; ++side) {
    const int64_t *p = t.q[side], *e = t.q[(side + 1) % 3];
    // x is even and the ends are odd, so an edge along y never lies at x.
    if ((2 * p[0] + 1 < x) == (2 * e[0] + 1 < x)) continue;
    const int64_t k = edge_cell(p, e, x);
    first = lesser(first, k);
    last = greater(last, k);
  }
  first = greater(first, int64_t{0});
  last = lesser(last, int64_t{t.cell_last[2]});
  if (first > last) return;
  const uint32_t row = kSpread.at[i] << (t.axis + 1) % 3 | kSpread.at[j] << (t.axis + 2) % 3;
  set_run(words, static_cast<uint32_t>(t.axis), row, static_cast<uint32_t>(first),
          static_cast<uint32_t>(last + 1));
}

// Sets the cells of a triangle whose normal along index 2 is 0.
inline void set_edge_on(const TurnedCorners& t, uint64_t* words) {
  // The edge that is longest in x covers the other two in this projection.
  int side = 0;
  int64_t width = -1;
  for (int s = 0; s < 3; ++s) {
    const int64_t d = t.q[(s + 1) % 3][0] - t.q[s][0];
    if ((d < 0 ? -d : d) > width) {
      width = d < 0 ? -d : d;
      side = s;
    }
  }
  const int64_t *p = t.q[side], *e = t.q[(side + 1) % 3];
  const int64_t dx = e[0] - p[0], dy = e[1] - p[1];
  if (dx == 0 || dy == 0 || ((dx & -dx) != (dy & -dy))) return;
  const int64_t low = lesser(p[0], e[0]), high = greater(p[0], e[0]);
  const int64_t i_first = greater((low + 128) >> 8, int64_t{0});
  const int64_t i_last = lesser((high - 128) >> 8, int64_t{t.cell_last[0]});
  for (int64_t i = i_first; i <= i_last; ++i) {
    const int64_t rise = dy * (512 * i + 256 - (2 * p[0] + 1));
    if (rise % dx != 0) continue;
    const int64_t y = 2 * p[1] + 1 + rise / dx - 256;
    if ((y & 511) != 0 || y < 0 || y >> 9 > t.cell_last[1]) continue;
    set_edge_on_line(t, words, i, y >> 9);
  }
}

}  // namespace
}  // namespace voxeld
