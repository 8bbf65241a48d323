// What a device offers to do of fill=solid and fill=shell.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/voxel/solid/inside.h"
#include "server/voxel/tile_pipeline.h"

namespace voxeld {

// A TilePipeline that finds the inside, too. Between two jobs of the pipeline; one thread.
class DeviceInside {
 public:
  virtual ~DeviceInside() = default;

  // As voxeld::find_inside(), with the same tiles, in any order. stats.pipeline tells how; adds
  // passes and the peak of bytes to `stats`. Errors: also grid-too-large and device-unavailable
  // where the device lacks memory, internal with the driver's words.
  virtual Status find_inside(const InsideJob& job, const ColumnProgress& progress,
                             std::vector<SparseTile>& tiles, AxisVotes& votes,
                             VoxelizeStats& stats) = 0;

  // As voxeld::flood_inside(). False where the CPU has to do it: `tiles` are then as they were.
  virtual Result<bool> flood_inside(std::span<const SparseTile> touched, const glm::ivec3& dims,
                                    const ColumnProgress& progress, std::vector<SparseTile>& tiles,
                                    VoxelizeStats& stats) = 0;

  // Bytes on the device at the peak of either: an upper bound.
  virtual int64_t inside_bytes(const glm::ivec3& dims, Sign sign) const = 0;
};

}  // namespace voxeld
