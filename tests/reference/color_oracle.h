// The oracle for the colour channel: the area average of the surface's colour in each cell, in
// double precision. Each triangle is clipped to the cell's cube as a polygon, and the polygon's
// colour is integrated by many samples; nothing is shared with the voxelizer, which uses a lattice
// of integers.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <vector>

#include "tests/reference/touch_oracle.h"

namespace voxeld::reference {

// Linear light RGBA at barycentric coordinates (of vertices 0, 1, 2) of triangle number t.
using ColorAt = std::function<std::array<double, 4>(size_t t, const std::array<double, 3>& bary)>;

struct CellColor {
  double area = 0;                      // of the surface in the cell, in voxel^2
  std::array<double, 4> linear_rgba{};  // area average
};

// Keyed by x + dims.x * (y + dims.y * z). Cells that are touched without area are absent.
// samples_per_voxel: along a side of what a triangle and a cell have in common, for colours that
// change faster than a sixth of that side.
std::map<size_t, CellColor> average_colors(const std::vector<Triangle>& triangles,
                                           const OracleGrid& grid, const ColorAt& color_at,
                                           double samples_per_voxel = 0);

// IEC 61966-2-1.
double srgb_from_linear(double linear);
double linear_from_srgb(double srgb);

}  // namespace voxeld::reference
