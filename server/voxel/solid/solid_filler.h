// fill=solid, shell and band: from a grid's surface to what is inside or near. Surface tiles come
// from any pipeline; the inside is the same whichever it was.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "server/voxel/cpu/worker_pool.h"
#include "server/voxel/solid/coverage.h"
#include "server/voxel/solid/device_inside.h"
#include "server/voxel/solid/inside.h"
#include "server/voxel/tile_pipeline.h"

namespace voxeld {

// One thread.
class SolidFiller {
 public:
  // `device`: finds the inside where it is given; otherwise the pool's threads do. What remains
  // theirs: which sign `auto` takes, distances, and uniting. host_bytes_max: of what only the
  // inside of the mesh tells the size of.
  SolidFiller(WorkerPool& pool, int64_t host_bytes_max, DeviceInside* device = nullptr)
      : pool_(pool), host_bytes_max_(host_bytes_max), device_(device) {}

  // Makes the tiles that rule=touch gives, without attributes, in any order.
  using TouchTiles = std::function<Result<std::vector<SparseTile>>()>;

  // Turns the surface in `tiles` (by the plan's rule; none for Rule::kNone) into what the plan's
  // fill asks for, in Morton order of coord, with distances and the coverage of volumes where the
  // plan wants them: distances also for Fill::kSurface, whose tiles must be in that order. `touch`
  // is called where the fill needs the cells that rule=touch gives and `tiles` are others. Errors:
  // those of `touch` and `progress`, which is called with tile columns done of tile_column_count();
  // grid-too-large where attributes of the inside need too much memory.
  Status fill(const VoxelizePlan& plan, const TouchTiles& touch, const ColumnProgress& progress,
              std::vector<SparseTile>& tiles, VoxelizeStats& stats);

 private:
  struct Choice {
    Sign sign;
    bool closed;
  };
  Choice choose(const VoxelizePlan& plan, const FillMesh& mesh, FillStats& fill) const;
  Result<std::vector<SparseTile>> inside(const VoxelizePlan& plan, const FillMesh& mesh,
                                         const TouchTiles& touch, const ColumnProgress& progress,
                                         const std::vector<SparseTile>& surface, Sign sign,
                                         AxisVotes& votes, VoxelizeStats& stats);

  // What is inside by the plan's sign, and how that was found.
  Result<std::vector<SparseTile>> find_signed(const VoxelizePlan& plan, const FillMesh& mesh,
                                              const TouchTiles& touch,
                                              const ColumnProgress& progress,
                                              const std::vector<SparseTile>& surface,
                                              VoxelizeStats& stats);
  // Surface and inside in one, with what the plan says of the inside's attributes.
  Status unite(const VoxelizePlan& plan, const ColumnProgress& progress,
               std::vector<SparseTile> found, std::vector<SparseTile>& tiles,
               VoxelizeStats& stats) const;

  std::optional<CoverageCounts> coverage_;  // where the plan wants that of volumes
  WorkerPool& pool_;
  int64_t host_bytes_max_;
  DeviceInside* device_;
};

// An upper estimate of what distances and bands need beside surface and inside.
int64_t distance_bytes(const FillMesh& mesh, const GridSpec& spec, const VoxelizeOptions& options,
                       const WantedChannels& channels);

}  // namespace voxeld
