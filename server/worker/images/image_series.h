// Images of a grid or of the frames of a sequence, taken one after another and encoded.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/worker/frames/make_frames.h"
#include "server/worker/grids/grid_input.h"
#include "server/worker/task/task_run.h"

namespace voxeld {

// A grid to draw, either in memory or in its container.
struct DrawnInput {
  std::shared_ptr<const LoadedGrid> whole;
  std::unique_ptr<GridInput> container;
  std::unique_ptr<GridTiles> resident;
  const TileSource& tiles() const {
    return resident != nullptr ? static_cast<const TileSource&>(*resident) : container->tiles();
  }
};
// `key`: the grid's key in the cache. Errors: those of GridInput.
Result<DrawnInput> open_drawn(TaskRun& run, const std::filesystem::path& container,
                              const std::string& key);

// Images to be taken, all of one size.
struct Shots {
  std::vector<double> durations_s;  // one per image
  std::function<Result<Picture>(size_t)> take;
};

// Draws one image of the grid, or of as much of it as is needed. Stages: parse, render.
Result<Picture> take_picture(TaskRun& run, const DrawnInput& input, const std::string& key,
                             const RequestOptions& options);

// Views from options.render.turntable sides of the grid.
Shots turntable_shots(TaskRun& run, const std::filesystem::path& container, const std::string& key,
                      const RequestOptions& options);
// Views of each frame by one camera, which frames the box of all grids. `sequence` must outlive
// them.
Shots frame_shots(TaskRun& run, const MadeSequence& sequence, const RequestOptions& options);
// The camera of frame_shots() as RenderOptions::matrix; a matrix of the request stays.
RenderOptions frame_camera(const GridSpec& spec, const RequestOptions& options);

// Lists one image as the result.
Status write_picture(TaskRun& run, const Picture& picture);
// Takes all images and lists them as the result, in the request's kind. Each is encoded while the
// next one is drawn. Errors: those of the images; invalid-option for a sheet that is too large.
Status write_shots(TaskRun& run, const Shots& shots, const RenderOptions& options);

}  // namespace voxeld
