// The CPU goes on with a job that failed on its device: all pipelines make the same bytes.
#pragma once

#include "proto/options/options.h"
#include "proto/result.h"
#include "server/voxel/pipelines/tile_pipeline.h"

namespace voxeld {

// Whether the CPU may go on after a pipeline, a fill or a move of vertices failed on the device.
// The request must leave the pipeline to voxeld, and the error must be the device's (a shader that
// does not compile, no memory, a lost context), not the job's (cancelled, too large).
bool may_fall_back(const VoxelizeOptions& options, const Error& error);

// Records that pipeline cpu makes what follows, and the failure if it is the job's first.
void record_fallback(const Error& error, VoxelizeStats& stats);

}  // namespace voxeld
