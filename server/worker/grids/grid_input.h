// A native container as the input of a task, read tile by tile. Levels, regions and images of grids
// larger than memory are made from it.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>

#include "proto/options/options.h"
#include "server/base/disk/file.h"
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

// Writes the whole grid in the request's format and lists it as the result. Errors: those of
// write_grid().
Status write_result(TaskRun& run, const Grid& grid, const OutputOptions& output);

// Makes the part of a grid that the request's level, region and crop select, mirrored and with the
// colours of its palette, and lists it as the result in the request's format. A native result in
// the codec of stored grids is listed as a grid too. The completion's meta describes the selection.
// Containers and Zarr stores are written tile by tile; other formats are made in memory. Stage:
// encode. Errors:
// those of Selection, check_encodable(), check_channels().
Status write_selection(TaskRun& run, const TileSource& source, const OutputOptions& output);
// Whether write_selection() makes a request's result from the stored tiles, not from a grid in
// memory.
bool is_made_from_tiles(const OutputOptions& output);

// Facts of the selection, beside those of every grid: {level, level_rule, region,
// keep, dilate, erode, hollow, neighbors, labels, mirror, palette_colors, of}.
nlohmann::json selection_facts(const Grid& whole, const OutputOptions& output);

// The placement of the selection from a grid. Errors: invalid-option.
Result<GridSpec> selected_spec(const GridSpec& spec, const OutputOptions& output);

}  // namespace voxeld
