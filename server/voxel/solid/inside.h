// Which cells of a grid are inside of a mesh: ../README.md, "What is inside".
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "proto/options.h"
#include "proto/result.h"
#include "proto/sparse_tile.h"
#include "server/voxel/cpu/worker_pool.h"
#include "server/voxel/solid/fill_mesh.h"

namespace voxeld {

// How cells that lie on the mesh's surface are found, for what counts only the others.
struct SurfaceTiles {
  std::span<const SparseTile> tiles;  // of the grid, in any order

  // nullptr where the tile has no surface.
  const SparseTile* find(const glm::ivec3& coord) const;
};

// Of a brick's cells, the number that the surface of its tile (or none) does not have.
int64_t count_beside(const BrickMask& cells, const SparseTile* surface, uint32_t morton);

// Cells beside the surface, by what the three axes say of them.
struct AxisVotes {
  int64_t inside = 0;    // by one axis or more, surface or not
  int64_t disagree = 0;  // that are not surface, and not inside by all
};

struct InsideJob {
  const FillMesh& mesh;
  glm::ivec3 dims;
  // kParity, kNonzero, kMajority, kWinding; kAuto stands for majority, and winding where the axes
  // disagree.
  Sign sign = Sign::kParity;
  SurfaceTiles surface;
};

// Called as tile columns get done; an error ends the work.
using ColumnProgress = std::function<Status(size_t done)>;

// One part of the work and of progress for each.
size_t tile_column_count(const glm::ivec3& dims);

// Appends the tiles with cells inside, canonical and without attributes, in any order. `votes`: of
// kMajority and kAuto.
Status find_inside(const InsideJob& job, WorkerPool& pool, const ColumnProgress& progress,
                   std::vector<SparseTile>& tiles, AxisVotes& votes);

// The same, whose tiles go to `take` on the calling thread as columns get done, some at a time.
using TakeInside = std::function<void(std::vector<SparseTile>)>;
Status find_inside(const InsideJob& job, WorkerPool& pool, const ColumnProgress& progress,
                   const TakeInside& take, AxisVotes& votes);

}  // namespace voxeld
