// The steps of which the tasks in run_task.cpp consist.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include "proto/messages/task_api.h"
#include "proto/options/options.h"
#include "server/base/clock.h"
#include "server/worker/device_slice.h"
#include "server/worker/engine.h"
#include "server/worker/task_monitor.h"

namespace voxeld {

// The state of one running task.
struct TaskRun {
  Engine& engine;
  const Task& task;
  const std::filesystem::path& scratch;
  TaskMonitor& monitor;
  TaskCompletion completion;  // filled in step by step
  DeviceSlice slice;          // for passes over the device; not for reading and encoding
};

// Measures one stage and reports it to the monitor.
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

// The native container as a grid, also from the cache. Stage: parse.
Result<std::shared_ptr<const LoadedGrid>> load_input_grid(TaskRun& run);

// Adds the container's meta, and this device, to the completion's meta.
void add_input_meta(TaskRun& run, const std::string& container_meta);

// The options that decide the voxels of a grid. Output format and pipeline are excluded, so equal
// grids have equal containers.
nlohmann::json grid_options(const RequestOptions& options);
// The same for a frame of an animation, without its number: other frames may equal it.
nlohmann::json frame_grid_options(const RequestOptions& options);

// The meta object of every container. It does not mention pipeline, device or time. facts: of
// grid_facts() and others.
std::string container_meta(const Task& task, const Scene& scene, const nlohmann::json& options,
                           const nlohmann::json& facts, const std::optional<FillStats>& fill,
                           const std::optional<MeshTopology>& topology, LabelKind labels);
// Adds facts about the making of a grid or sequence, and its container's meta, to the completion.
void add_making_meta(TaskRun& run, const std::string& container_meta, const VoxelizeStats& stats);

// A scene to voxelize.
struct SceneInput {
  const Scene& scene;
  std::string key;                 // of its topology
  SharedFrames* frames = nullptr;  // set for a frame that is placed together with others
};

// Checks that the grid can be made and written as the request's output, makes it, and lists its
// native container under `roles`. For result_codec, it lists a second one as the result. Stages:
// voxelize and encode.
struct WrittenGrid {
  std::optional<LoadedGrid> kept;  // set if the request's output needs it, or if it is small
  std::string id;                  // of the container
  std::filesystem::path path;
};
Result<WrittenGrid> voxelize_to_file(TaskRun& run, const SceneInput& input,
                                     const RequestOptions& options);
// Checks that the tenant may make a grid of this size, or `frames` of them, in one job. Errors:
// grid-too-large with the numbers.
Status check_cells(const Task& task, const GridSpec& spec, size_t frames = 1);
// Stores the grid in the cache: a client that voxelizes a mesh mostly looks at it next.
void keep_grid(TaskRun& run, WrittenGrid& made, const std::string& key);
// Refuses `frames` for a single grid. Errors: invalid-option.
Status check_one_grid(const AnimationOptions& options);
// The cache key, for images, of the grid that a mesh and options give.
std::string render_key(const Task& task, const RequestOptions& options);
// Renders one image. Stage: render.
Result<Picture> render_picture(TaskRun& run, const LoadedGrid& grid, const std::string& grid_key,
                               const RenderOptions& options);

// The path of the next output in the scratch directory.
std::filesystem::path next_output(const TaskRun& run);
// Lists an existing file under `roles` (space-separated).
void list_output(TaskRun& run, const std::filesystem::path& path, std::string_view roles,
                 std::string_view media_type, std::string_view extension);
// Writes bytes to the scratch directory and lists them under `roles` (space-separated).
Status add_output(TaskRun& run, std::string_view roles, std::span<const uint8_t> bytes,
                  std::string_view media_type, std::string_view extension);

// The meta that every grid has: dims, origin, voxel_size, voxel_count, channels, content_hash. The
// tiles in `grid` are ignored.
nlohmann::json grid_facts(const Grid& grid, uint64_t voxel_count, const std::string& content_hash);
nlohmann::json grid_facts(const LoadedGrid& grid);
// Adds to the completion's warnings, up to a limit; one more warning reports what was omitted.
void add_warnings(TaskRun& run, const std::vector<Warning>& warnings);
// Adds the members of `facts` to the completion's meta.
void add_meta(TaskRun& run, const nlohmann::json& facts);

}  // namespace voxeld
