// Upper estimates of what a task adds to the worker's memory, before it is done. They are told in
// the answer's meta beside the peak that was measured.
#pragma once

#include <cstdint>

#include "server/grid/tile_source.h"
#include "server/voxel/estimate.h"
#include "server/worker/task_run.h"

namespace voxeld {

// From the scene to the encoded result. Of grids that might be large the mesh is snapped and binned
// for it, as for Voxelizer::estimate().
int64_t voxelize_bytes(const Engine& engine, const Scene& scene, const RequestOptions& options,
                       const Placed& placed);

// Of the grid alone, its tiles in memory.
int64_t grid_bytes(const Engine& engine, const Scene& scene, const RequestOptions& options,
                   const Placed& placed);
// Writing a native sequence of frames of that many bytes from their containers (NativeSequence).
int64_t sequence_bytes(int64_t frame_bytes);

// A batch of decoded tiles and what is made of them, until the file; other formats hold the whole
// result, whose cells are counted.
int64_t selection_bytes(const TileSource& source, const TileSource& selected,
                        const OutputOptions& output);

// The tiles and tables of a picture, at most picture_limits, and the picture.
int64_t picture_bytes(Engine& engine, const TileSource& source, const RenderOptions& render);

// Meta: host_bytes_estimate, the resident bytes now and `more`, but no less than the peak so far;
// that is what the task's turn asks for, with so many bytes on the device.
void expect_bytes(TaskRun& run, int64_t more, int64_t device_bytes = 0);

}  // namespace voxeld
