// A native container as the input of a task, tile by tile: what levels, regions and pictures of
// grids larger than memory are made from.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>

#include "proto/options.h"
#include "server/base/file.h"
#include "server/grid/tile_source.h"
#include "server/worker/task_run.h"

namespace voxeld {

// The run must outlive it.
class GridInput {
 public:
  // Errors: those of the file, of GridReader.
  static Result<std::unique_ptr<GridInput>> open(TaskRun& run, const std::filesystem::path& path);

  // Each tile that is read is progress, and looks whether the task was cancelled. Pages of the file
  // do not stay resident.
  const ContainerTiles& tiles() const { return *tiles_; }

 private:
  GridInput(TaskRun& run, MappedFile file) : run_(run), file_(std::move(file)) {}
  Status before_tile();

  TaskRun& run_;
  MappedFile file_;
  std::optional<ContainerTiles> tiles_;
  std::atomic<int64_t> read_{0};
};

// Makes the part of a grid that the request's level and region ask for and lists it as the result
// in the request's format. A native result in the codec that grids are kept in is a grid itself.
// Tells of it in the completion's meta. Containers are written tile by tile; other formats are made
// in memory. Stage: encode. Errors: those of Selection, check_encodable().
Status write_selection(TaskRun& run, const TileSource& source, const OutputOptions& output);

// What the selection is, beside what every grid says of itself: {level, level_rule, region, of}.
nlohmann::json selection_facts(const Grid& whole, const OutputOptions& output);

// The place of what is selected of a grid. Errors: invalid-option.
Result<GridSpec> selected_spec(const GridSpec& spec, const OutputOptions& output);

}  // namespace voxeld
