// Signed distances from cells to a mesh's triangles, for fill=band and the channel `distance`. See
// ../README.md, "Distance".
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "server/base/parallel.h"
#include "server/voxel/solid/distance/brick_index.h"
#include "server/voxel/solid/distance/triangle_tree.h"
#include "server/voxel/solid/inside/inside.h"

namespace voxeld {

// A tile with the distance of each voxel of its masks, in their order, in 1/kDistanceSteps of the
// unit that the tree's scale decides: a voxel or the shortest edge of one.
struct DistanceTile {
  SparseTile tile;
  std::vector<int16_t> distance;
};

struct DistanceJob {
  const TriangleTree& triangles;
  glm::ivec3 dims;
  const BrickIndex& inside;  // cells whose distance is negative
};

// Finds the tiles of the cells whose centre is at most `thickness` voxels from a triangle, in any
// order. progress: called from time to time, with 0 columns done. The tree must have scale 1.
Status find_band(const DistanceJob& job, double thickness, ThreadTeam& team,
                 const ColumnProgress& progress, std::vector<DistanceTile>& tiles);

// Distances of the voxels of a tile's masks. The mesh must have at least one triangle.
std::vector<int16_t> distances_of_tile(const DistanceJob& job, const SparseTile& tile,
                                       ThreadTeam& team);

// An upper bound of a band's cells: those of the cubes that are near the triangles' boxes.
int64_t band_cells_max(const FillMesh& mesh, const glm::ivec3& dims, double thickness);

}  // namespace voxeld
