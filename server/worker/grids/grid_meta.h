// The meta of grids: what a container and the result of a task tell about it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "proto/messages/task_api.h"
#include "proto/options/options.h"
#include "proto/result.h"
#include "server/grid/grid.h"
#include "server/scene/core/scene.h"
#include "server/voxel/voxelize.h"
#include "server/worker/mesh/mesh_topology.h"
#include "server/worker/task/task_run.h"

namespace voxeld {

// The options that decide the voxels of a grid. Output format and pipeline are excluded, so equal
// grids have equal containers.
nlohmann::json grid_options(const RequestOptions& options);
// The same for a frame of an animation, without its number: other frames may equal it.
nlohmann::json frame_grid_options(const RequestOptions& options);

// The meta that every grid has: dims, origin, voxel_size, voxel_count, channels, content_hash. The
// tiles in `grid` are ignored.
nlohmann::json grid_facts(const Grid& grid, uint64_t voxel_count, const std::string& content_hash);
nlohmann::json grid_facts(const LoadedGrid& grid);
// Its parts: dims, origin and voxel_size; and the list of the channels' names.
nlohmann::json place_facts(const GridSpec& spec);
nlohmann::json channel_facts(const ChannelSet& channels);

// The meta object of every container. It does not mention pipeline, device or time. facts: of
// grid_facts() and others.
GridMeta container_meta(const Task& task, const Scene& scene, const nlohmann::json& options,
                        const nlohmann::json& facts, const std::optional<FillStats>& fill,
                        const std::optional<MeshTopology>& topology, LabelKind labels);
// Adds facts about the making of a grid or sequence, and its container's meta, to the task's meta.
void add_making_meta(TaskRun& run, const GridMeta& container_meta, const VoxelizeStats& stats);
// About a grid that is probably not what its request meant: "no-voxels", "empty-solid",
// "ambiguous-solid".
std::vector<Warning> grid_warnings(const VoxelizeOptions& options, uint64_t voxel_count,
                                   const VoxelizeStats& stats);
// Records for the worker how its device did, if the job used it. Call it after the voxelizer, with
// its outcome: a job that fails elsewhere, such as in its plan, tells nothing about the device.
void note_device(Engine& engine, const VoxelizeStats& stats, const Status& made);
// Adds the container's meta, and this device, to the task's meta.
void add_input_meta(TaskRun& run, const GridMeta& container_meta);

}  // namespace voxeld
