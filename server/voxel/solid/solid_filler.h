// The fills solid, shell and band: from a grid's surface to the cells inside or near it. Surface
// tiles come from any pipeline; the inside does not depend on which.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "server/base/parallel.h"
#include "server/voxel/pipelines/tile_pipeline.h"
#include "server/voxel/solid/coverage.h"
#include "server/voxel/solid/device_inside.h"
#include "server/voxel/solid/inside/inside.h"

namespace voxeld {

// Fills grids. Not thread-safe.
class SolidFiller {
 public:
  // device: finds the inside; null leaves that to `finder`, whose threads are used for all else,
  // too. The CPU always chooses the sign of `auto`, measures distances and unites tiles.
  // host_bytes_max: limit for memory whose size is known only once the mesh's boundary or the
  // inside is.
  SolidFiller(InsideFinder& finder, int64_t host_bytes_max, DeviceInside* device = nullptr)
      : finder_(finder), team_(finder.team()), host_bytes_max_(host_bytes_max), device_(device) {}

  // Makes the tiles of rule=touch, without attributes, in any order.
  using TouchTiles = std::function<Result<std::vector<SparseTile>>()>;

  // Turns the surface in `tiles` into what the plan's fill asks for, in Morton order of coord. The
  // surface follows the plan's rule; it is empty for Rule::kNone. Distances and the coverage of
  // volumes are added if the plan wants them. Distances are measured for Fill::kSurface too, whose
  // tiles must be in Morton order. `touch` is called if the fill needs the cells of rule=touch and
  // `tiles` holds others. Errors: those of `touch` and `progress`, which is called with tile
  // columns done of tile_column_count(); grid-too-large if attributes of the inside, or winding
  // numbers, need too much memory.
  Status fill(const VoxelizePlan& plan, const TouchTiles& touch, const ColumnProgress& progress,
              std::vector<SparseTile>& tiles, VoxelizeStats& stats);

 private:
  class TouchCells;
  // Shared by the steps of fill().
  struct Work {
    const VoxelizePlan& plan;
    const FillMesh& mesh;
    const std::vector<SparseTile>& surface;
    TouchCells& touch;
    const ColumnProgress& progress;
    VoxelizeStats& stats;
  };

  // The sign to take for the plan's; kAuto if the mesh is not closed. Errors: grid-too-large.
  Result<Sign> choose(const Work& work, FillStats& fill) const;
  // The inside by a sign other than kAuto. keeps_doubtful: as in InsideJob.
  Result<std::vector<SparseTile>> inside(const Work& work, Sign sign, bool keeps_doubtful,
                                         AxisVotes& votes);
  Result<std::vector<SparseTile>> inside_auto(const Work& work, FillStats& fill);

  // Discards what the device found before it failed, if the CPU may go on; else the error.
  static Status fall_back(const VoxelizePlan& plan, const Error& error,
                          std::vector<SparseTile>& tiles, VoxelizeStats& stats);

  // Finds the inside by the plan's sign, and records how.
  Result<std::vector<SparseTile>> find_signed(const Work& work);
  // Another sign by which cells beside the surface are inside, if there are none in `found`.
  Result<std::optional<Sign>> sign_with_inside(const Work& work,
                                               const std::vector<SparseTile>& found);
  // Unites surface and inside, with attributes of the inside as the plan asks.
  Status unite(const VoxelizePlan& plan, const ColumnProgress& progress,
               std::vector<SparseTile> found, std::vector<SparseTile>& tiles,
               VoxelizeStats& stats) const;

  std::optional<CoverageCounts> coverage_;  // set if the plan wants the coverage of volumes
  InsideFinder& finder_;
  ThreadTeam& team_;
  int64_t host_bytes_max_;
  DeviceInside* device_;
};

// Checks that a unit of distances suits the voxels. Errors: invalid-option if their edges
// differ by more than limits::kDistanceAspectMax.
Status check_distance_unit(const GridSpec& spec, DistanceUnit unit);

// An upper estimate, in bytes, of the trees of triangles for winding numbers, distances and bands.
// Winding numbers of meshes with more open edges than triangles take more, which SolidFiller
// checks.
int64_t tree_bytes(const VoxelizeOptions& options, int64_t triangles);

// An upper estimate of the bytes that distances and bands need in addition to surface, inside and
// trees.
int64_t distance_bytes(const Scene& scene, const SnappedMesh& mesh, const Placed& placed,
                       const VoxelizeOptions& options, const WantedChannels& channels);

}  // namespace voxeld
