// An asset that is a grid already: a file of voxels (server/volumes).
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "proto/options/options.h"
#include "server/worker/grids/make_grid.h"
#include "server/worker/task/task_run.h"

namespace voxeld {

// Whether the first bytes of the task's input are those of a file of voxels. Errors: of the file.
Result<bool> is_volume_input(const Task& task);

// Reads the grid of the file and lists it as voxelize_to_file() lists what it makes. Options of
// placement, surface and colour have no use; the warning "unused-options" names those that differ
// from their defaults. Stages: parse and encode. Errors: load_volume()'s; invalid-option for
// animations and variants, which only meshes have; as voxelize_to_file().
Result<WrittenGrid> volume_to_file(TaskRun& run, const RequestOptions& options);

// The members of describe_scene(), without triangles, and voxels {dims, origin, voxel_size,
// voxel_count, channels}.
Result<nlohmann::json> describe_volume_input(TaskRun& run);

}  // namespace voxeld
