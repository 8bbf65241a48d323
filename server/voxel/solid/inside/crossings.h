// Crossings of the centre lines of columns of cells with triangles; see ../README.md, "What is
// inside".
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/voxel/solid/inside/fill_mesh.h"

namespace voxeld {

// The axes of a sweep. Columns run along w. u, v, w are the axes rotated cyclically, as for
// attributes: axis z has (x,y,z), axis x (y,z,x), axis y (z,x,y).
struct SweepAxes {
  int u, v, w;
};
constexpr SweepAxes sweep_axes(int axis) {
  return {(axis + 1) % 3, (axis + 2) % 3, axis};
}

// A rectangle of columns, at most kTileSide a side.
struct ColumnWindow {
  int u_first = 0, v_first = 0;  // cells of the grid
  int u_count = 0, v_count = 0;
};

// A crossing: the column within the window, and the first cell whose centre is not below the
// crossing.
//
//   bit 31        30..16      15..8    7..0
//   faces down    first cell  v        u
//
// The first cell is 0 if the crossing lies below the grid. A face that faces down has n.w < 0: a
// path that goes up enters the mesh there, +1.
using Crossing = uint32_t;
constexpr uint32_t crossing_column(Crossing c) {
  return c & 0xffffu;
}
constexpr int crossing_cell(Crossing c) {
  return static_cast<int>(c >> 16 & 0x7fffu);
}
constexpr int crossing_winding(Crossing c) {
  return (c >> 31) != 0 ? 1 : -1;
}
constexpr Crossing make_crossing(uint32_t column, int first_cell, bool faces_down) {
  return column | static_cast<uint32_t>(first_cell) << 16 | (faces_down ? 1u << 31 : 0u);
}

// Appends the crossings of the listed triangles within the window, below the grid's upper end.
// cells_w: cells of the grid along w, at most 16384.
void append_crossings(const FillMesh& mesh, std::span<const uint32_t> triangles, int axis,
                      const ColumnWindow& window, int cells_w, std::vector<Crossing>& out);

// First and last cell on an axis whose centre lies in the closed range between two q. first > last
// if there is none.
struct CentreRange {
  int first, last;
};
constexpr CentreRange centre_range(int q_min, int q_max, int sub_voxel_bits) {
  const int half = 1 << (sub_voxel_bits - 1);
  return {((q_min - half) >> sub_voxel_bits) + 1, (q_max - half) >> sub_voxel_bits};
}

}  // namespace voxeld
