// Splitting of triangles that are too long for exact arithmetic in large grids. It happens before
// they are snapped.
#pragma once

#include <array>
#include <vector>

#include "server/voxel/triangles/clip.h"

namespace voxeld {

// Grids with a longer side split edges that are longer than kEdgeCellsMax on an axis. No corner is
// then farther from a touched tile than in the largest grid without splitting. All terms of the
// overlap test and of attributes keep their bounds.
inline constexpr int kUnsplitGridSide = 2048;
inline constexpr double kEdgeCellsMax = 1536;

using SplitTriangle = std::array<ClipCorner, 3>;

// Appends triangles that cover the given one, in its orientation, none with too long an edge. Edges
// are halved, and the split depends on the edge's two ends alone. Triangles that share an edge
// therefore get the same points, bit for bit.
void split_triangle(const SplitTriangle& triangle, std::vector<SplitTriangle>& out);

}  // namespace voxeld
