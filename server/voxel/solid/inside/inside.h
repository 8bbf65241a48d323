// The cells of a grid that are inside a mesh; see ../README.md, "What is inside".
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "proto/options/options.h"
#include "proto/result.h"
#include "server/base/parallel.h"
#include "server/voxel/solid/inside/fill_mesh.h"

namespace voxeld {

// The surface's cells, for statistics that count only cells beside the surface.
struct SurfaceTiles {
  std::span<const SparseTile> tiles;  // the grid's, in any order

  // nullptr if the tile has no surface.
  const SparseTile* find(const glm::ivec3& coord) const;
};

// The number of a brick's cells that are not in `surface`, the surface of its tile (or null).
int64_t count_beside(const BrickMask& cells, const SparseTile* surface, uint32_t morton);

// Counts of cells by what the three axes say of them.
struct AxisVotes {
  int64_t inside = 0;    // by one axis or more; surface cells included
  int64_t disagree = 0;  // not surface, and not inside by all axes
  // The cells on which the axes disagree, if the job asks for them, in any order of tiles.
  std::vector<SparseTile> doubtful{};
};

struct InsideJob {
  const FillMesh& mesh;
  glm::ivec3 dims;
  Sign sign = Sign::kParity;  // kParity, kNonzero, kMajority or kWinding
  SurfaceTiles surface;
  bool keeps_doubtful = false;  // AxisVotes::doubtful; of kMajority
};

// Called as tile columns are finished; an error ends the work.
using ColumnProgress = std::function<Status(size_t done)>;

// Number of tile columns. Each is one unit of work and of progress.
size_t tile_column_count(const glm::ivec3& dims);

// Finds the inside of one mesh after the other. It keeps its memory from job to job: 2.5 MiB for
// each thread, 8 MiB after a job with votes of the axes. Not thread-safe.
class InsideFinder {
 public:
  // The team must outlive the finder.
  explicit InsideFinder(ThreadTeam& team);
  ~InsideFinder();
  InsideFinder(const InsideFinder&) = delete;
  InsideFinder& operator=(const InsideFinder&) = delete;

  ThreadTeam& team() const { return team_; }

  // Appends the tiles with inside cells, canonical and without attributes, in any order. votes: set
  // by kMajority only.
  Status find(const InsideJob& job, const ColumnProgress& progress, std::vector<SparseTile>& tiles,
              AxisVotes& votes);

  // The same, but tiles go to `take` in portions as columns are finished. It runs on the calling
  // thread.
  using Take = std::function<void(std::vector<SparseTile>)>;
  Status find(const InsideJob& job, const ColumnProgress& progress, const Take& take,
              AxisVotes& votes);

 private:
  struct Memory;
  class Run;
  ThreadTeam& team_;
  std::unique_ptr<Memory> memory_;  // null until a job needs it
};

}  // namespace voxeld
