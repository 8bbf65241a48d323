// The interface by which a device finds insides, for fill=solid and fill=shell.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/voxel/pipelines/tile_pipeline.h"
#include "server/voxel/solid/inside/inside.h"

namespace voxeld {

// A TilePipeline that also finds insides. Called between two jobs of the pipeline. Not thread-safe.
class DeviceInside {
 public:
  virtual ~DeviceInside() = default;

  // Same as InsideFinder::find(), with the same tiles in any order. stats.pipeline selects raster
  // or compute. Adds passes and the peak of bytes to `stats`. Errors: also grid-too-large and
  // device-unavailable if the device lacks memory, internal with the driver's words.
  virtual Status find_inside(const InsideJob& job, const ColumnProgress& progress,
                             std::vector<SparseTile>& tiles, AxisVotes& votes,
                             VoxelizeStats& stats) = 0;

  // Same as voxeld::flood_inside(). Returns false, with `tiles` unchanged, if the CPU must do it.
  virtual Result<bool> flood_inside(std::span<const SparseTile> touched, const glm::ivec3& dims,
                                    const ColumnProgress& progress, std::vector<SparseTile>& tiles,
                                    VoxelizeStats& stats) = 0;

  // An upper bound of the peak bytes on the device, for either function.
  virtual int64_t inside_bytes(const glm::ivec3& dims, Sign sign) const = 0;
};

}  // namespace voxeld
