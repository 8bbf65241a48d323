// Pictures of a grid or of the frames of a sequence, one after another, and what becomes of them.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/worker/grid_input.h"
#include "server/worker/make_frames.h"
#include "server/worker/task_run.h"

namespace voxeld {

// A grid to draw: in memory, or in its container.
struct DrawnInput {
  std::shared_ptr<const LoadedGrid> whole;
  std::unique_ptr<GridInput> container;
  std::unique_ptr<GridTiles> resident;
  const TileSource& tiles() const {
    return resident != nullptr ? static_cast<const TileSource&>(*resident) : container->tiles();
  }
};
// `key`: of the grid's cache entry. Errors: those of GridInput.
Result<DrawnInput> open_drawn(TaskRun& run, const std::filesystem::path& container,
                              const std::string& key);

// Pictures to be taken, all of one size.
struct Shots {
  std::vector<double> durations_s;  // one per picture
  std::function<Result<Picture>(size_t)> take;
};

// One picture of the grid, or of as much of it as is needed. Stages: parse, render.
Result<Picture> take_picture(TaskRun& run, const DrawnInput& input, const std::string& key,
                             const RequestOptions& options);

// From options.render.turntable sides of the grid.
Shots turntable_shots(TaskRun& run, const std::filesystem::path& container, const std::string& key,
                      const RequestOptions& options);
// Of each frame, seen by one camera, which frames all of the grids' box. `sequence` must outlive
// them.
Shots frame_shots(TaskRun& run, const MadeSequence& sequence, const RequestOptions& options);
// The same camera, as RenderOptions::matrix; the request's own stays.
RenderOptions frame_camera(const GridSpec& spec, const RequestOptions& options);

// Takes one picture and lists it as the result.
Status write_picture(TaskRun& run, const Picture& picture);
// Takes all of them and lists them as the result, in the request's kind of picture. Each is encoded
// while the next one is drawn. Errors: those of the pictures; invalid-option for a sheet that is
// too large.
Status write_shots(TaskRun& run, const Shots& shots, const RenderOptions& options);

}  // namespace voxeld
