// A native container as the input of a task, read tile by tile. Levels, regions and images of grids
// larger than memory are made from it.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>

#include "proto/options/options.h"
#include "server/base/file.h"
#include "server/grid/tile_source.h"
#include "server/worker/task/task_run.h"

namespace voxeld {

// The run must outlive it.
class GridInput {
 public:
  // Errors: those of the file, of GridReader.
  static Result<std::unique_ptr<GridInput>> open(TaskRun& run, const std::filesystem::path& path);

  // Each tile read reports progress and checks for cancellation. Pages of the file do not stay
  // resident.
  const ContainerTiles& tiles() const { return *tiles_; }

 private:
  GridInput(TaskRun& run, MappedFile file) : run_(run), file_(std::move(file)) {}
  Status before_tile();

  TaskRun& run_;
  MappedFile file_;
  std::optional<ContainerTiles> tiles_;
  std::atomic<int64_t> read_{0};
};

// Makes the part of a grid that the request's level and region select, and lists it as the result
// in the request's format. A native result in the codec of stored grids is listed as a grid too.
// The completion's meta describes the selection. Containers are written tile by tile; other formats
// are made in memory. Stage: encode. Errors: those of Selection, check_encodable().
Status write_selection(TaskRun& run, const TileSource& source, const OutputOptions& output);

// Facts of the selection, beside those of every grid: {level, level_rule, region, of}.
nlohmann::json selection_facts(const Grid& whole, const OutputOptions& output);

// The placement of the selection from a grid. Errors: invalid-option.
Result<GridSpec> selected_spec(const GridSpec& spec, const OutputOptions& output);

}  // namespace voxeld
