// Makes the grid of a task: voxelizes a scene into containers, or reads a container.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "proto/options/options.h"
#include "server/voxel/voxelize.h"
#include "server/worker/grids/grid_file.h"
#include "server/worker/task/task_run.h"

namespace voxeld {

// The native container of the task's input as a grid, also from the cache. Stage: parse.
Result<std::shared_ptr<const LoadedGrid>> load_input_grid(TaskRun& run);

// A scene to voxelize.
struct SceneInput {
  const Scene& scene;
  std::string key;                 // of its topology
  SharedFrames* frames = nullptr;  // set for a frame that is placed together with others
};

// A grid whose native container is listed.
struct WrittenGrid {
  std::optional<LoadedGrid> kept;  // set if the request's output needs it, or if it is small
  std::string id;                  // of the container
  std::filesystem::path path;
};

// The native containers of a new grid: the one that is stored and, where the request wants another
// codec, one that is the result.
class NewContainers {
 public:
  NewContainers(TaskRun& run, const OutputOptions& asked);
  // Those to begin and to add tiles to.
  std::span<GridFile* const> files() const { return files_; }
  // Writes the files and lists them. The grid is not kept.
  Result<WrittenGrid> finish(const GridMeta& meta);

 private:
  TaskRun& run_;
  bool is_result_;
  GridFile stored_, result_;
  std::vector<GridFile*> files_;
};

// Checks that the grid can be made and written as the request's output, makes it, and lists its
// native container under `roles`. For result_codec, it lists a second one as the result. Stages:
// voxelize and encode.
Result<WrittenGrid> voxelize_to_file(TaskRun& run, const SceneInput& input,
                                     const RequestOptions& options);
// Stores the grid in the cache: a client that voxelizes a mesh mostly looks at it next.
void keep_grid(TaskRun& run, WrittenGrid& made, const std::string& key);

// Checks that the tenant may make a grid of this size, or `frames` of them, in one job. Errors:
// grid-too-large with the numbers.
Status check_cells(const Task& task, const GridSpec& spec, size_t frames = 1);
// Refuses `frames` for a single grid. Errors: invalid-option.
Status check_one_grid(const AnimationOptions& options);
// The cache key, for images, of the grid that a mesh and options give.
std::string render_key(const Task& task, const RequestOptions& options);

}  // namespace voxeld
