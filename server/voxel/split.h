// Splitting of triangles that are too long for exact arithmetic in large grids, before they are
// snapped.
#pragma once

#include <array>
#include <vector>

#include "server/voxel/clip.h"

namespace voxeld {

// Grids with a longer side split edges that are longer than kEdgeCellsMax on an axis. From the tile
// that it touches no corner is then farther than in the largest grid without splitting, so all
// terms of the overlap test and of attributes keep their bounds.
inline constexpr int kUnsplitGridSide = 2048;
inline constexpr double kEdgeCellsMax = 1536;

using SplitTriangle = std::array<ClipCorner, 3>;

// Appends triangles that cover the one given, in its orientation, none of whose edges is too long.
// Edges are halved, and what an edge becomes depends on its two ends alone: triangles that share it
// get the same points, bit for bit.
void split_triangle(const SplitTriangle& triangle, std::vector<SplitTriangle>& out);

}  // namespace voxeld
