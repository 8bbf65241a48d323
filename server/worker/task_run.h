// The steps that run_task.cpp's stories are made of.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include "proto/options.h"
#include "proto/task_api.h"
#include "server/base/stopwatch.h"
#include "server/worker/device_turn.h"
#include "server/worker/engine.h"
#include "server/worker/task_monitor.h"

namespace voxeld {

// One task while it runs.
struct TaskRun {
  Engine& engine;
  const Task& task;
  const std::filesystem::path& scratch;
  TaskMonitor& monitor;
  TaskCompletion completion;  // filled in step by step
  DeviceTurn turn;            // for passes over the device; not for reading and encoding
};

// Measures one stage and tells the monitor of it.
class StageTimer {
 public:
  StageTimer(TaskRun& run, std::string_view stage) : run_(run), stage_(stage) {
    run_.monitor.set_stage(stage);
  }
  ~StageTimer() { add_stage(run_.completion.timings, stage_, watch_.ms()); }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  TaskRun& run_;
  const std::string stage_;
  const Stopwatch watch_;
};

Result<RequestOptions> task_options(const Task& task, OptionScope scope);

// The native container as a grid, from the cache likewise. Stage: parse.
Result<std::shared_ptr<const LoadedGrid>> load_input_grid(TaskRun& run);

// Puts what a container says of itself, and what device this is, into the completion's meta.
void add_input_meta(TaskRun& run, const std::string& container_meta);

// The options that make a grid what it is: neither how it is written down nor what computes it,
// for equal grids shall have equal containers.
nlohmann::json grid_options(const RequestOptions& options);
// The same of a frame of an animation: which one it is, other frames may be equal to.
nlohmann::json frame_grid_options(const RequestOptions& options);

// The object that every container carries. It says nothing of pipeline, device or time. facts: of
// grid_facts() and others.
std::string container_meta(const Task& task, const Scene& scene, const nlohmann::json& options,
                           const nlohmann::json& facts, const std::optional<FillStats>& fill,
                           const std::optional<MeshTopology>& topology, LabelKind labels);
// What is known of the making of a grid or sequence, and what its container says.
void add_making_meta(TaskRun& run, const std::string& container_meta, const VoxelizeStats& stats);

// A scene to voxelize.
struct SceneInput {
  const Scene& scene;
  std::string key;                 // of its topology
  SharedFrames* frames = nullptr;  // of a frame that others are placed with
};

// Checks that the grid can be made and written as the request's output, makes it, and lists its
// native container under `roles`; for result_codec, a second one as the result. Stages: voxelize
// and encode.
struct WrittenGrid {
  std::optional<LoadedGrid> kept;  // where the request's output needs it, or it is not large
  std::string id;                  // of the container
  std::filesystem::path path;
};
Result<WrittenGrid> voxelize_to_file(TaskRun& run, const SceneInput& input,
                                     const RequestOptions& options);
// That the tenant may make a grid like this, or `frames` of them, in one job. Errors:
// grid-too-large with the numbers.
Status check_cells(const Task& task, const GridSpec& spec, size_t frames = 1);
// Keeps it in the cache: who has voxelized a mesh mostly looks at it next.
void keep_grid(TaskRun& run, WrittenGrid& made, const std::string& key);
// Errors: invalid-option where `frames` is asked for, of a grid.
Status check_one_grid(const AnimationOptions& options);
// Name of the grid that a mesh and options give, for pictures: the key of its cache entry.
std::string render_key(const Task& task, const RequestOptions& options);
// Stage: render.
Result<Picture> render_picture(TaskRun& run, const LoadedGrid& grid, const std::string& grid_key,
                               const RenderOptions& options);

// A place in the scratch directory for the next output.
std::filesystem::path next_output(const TaskRun& run);
// Lists what is there under `roles` (space-separated).
void list_output(TaskRun& run, const std::filesystem::path& path, std::string_view roles,
                 std::string_view media_type, std::string_view extension);
// Writes bytes to the scratch directory and lists them under `roles` (space-separated).
Status add_output(TaskRun& run, std::string_view roles, std::span<const uint8_t> bytes,
                  std::string_view media_type, std::string_view extension);

// The part of the meta object that every grid has: dims, origin, voxel_size, voxel_count, channels,
// content_hash. Of `grid`, its tiles do not count.
nlohmann::json grid_facts(const Grid& grid, uint64_t voxel_count, const std::string& content_hash);
nlohmann::json grid_facts(const LoadedGrid& grid);
// Adds to the completion's warnings, up to a limit that is told.
void add_warnings(TaskRun& run, const std::vector<Warning>& warnings);
// Adds the members of `facts` to the completion's meta.
void add_meta(TaskRun& run, const nlohmann::json& facts);

}  // namespace voxeld
