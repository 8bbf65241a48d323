// Upper estimates of the memory that a task adds to the worker, made before it runs. The response's
// meta has them beside the measured peak.
#pragma once

#include <cstdint>

#include "server/grid/tile_source.h"
#include "server/voxel/estimates/estimate.h"
#include "server/worker/task/task_run.h"

namespace voxeld {

// The estimate from the scene to the encoded result. For a grid that might be large, the mesh is
// snapped and binned for it, as in Voxelizer::estimate().
int64_t voxelize_bytes(const Engine& engine, const Scene& scene, const RequestOptions& options,
                       const Placed& placed);

// The estimate of the grid alone, with its tiles in memory.
int64_t grid_bytes(const Engine& engine, const Scene& scene, const RequestOptions& options,
                   const Placed& placed);
// The estimate of writing a native sequence from containers of that many bytes per frame
// (NativeSequence).
int64_t sequence_bytes(int64_t frame_bytes);

// The estimate of a batch of decoded tiles up to the written file. Other formats hold the whole
// result, whose cells are counted.
int64_t selection_bytes(const TileSource& source, const TileSource& selected,
                        const OutputOptions& output);

// The estimate of an image: its tiles and tables, at most image_limits, and its pixels.
int64_t image_bytes(Engine& engine, const TileSource& source, const RenderOptions& render);

// Writes host_bytes_estimate into meta: the resident bytes now plus `more`, but no less than the
// peak so far and earlier estimates of the task. The task's time slice requests resident bytes plus
// `more`, and `device_bytes`.
void expect_bytes(TaskRun& run, int64_t more, int64_t device_bytes = 0);

}  // namespace voxeld
