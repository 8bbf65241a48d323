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
struct ImageSeries {
  std::vector<double> durations_s;  // one per image
  std::function<Result<RenderImage>(size_t)> take;
};

// Draws one image of the grid, or of as much of it as is needed. Stages: parse, render.
Result<RenderImage> take_image(TaskRun& run, const DrawnInput& input, const std::string& key,
                               const RequestOptions& options);

// How long the images of frames are shown, in seconds: at the request's rate, or by the times of
// the frames. fps: as in frame_durations().
std::vector<double> image_durations(const std::vector<double>& times_s, double fps,
                                    const RenderOptions& options);
// The same for the views of a turntable.
std::vector<double> view_durations(const RenderOptions& options);
// Checks that images that are shown so long make a file of the request's kind, and expects the
// memory of a sheet. Call it before the task's first time slice; write_series() does, too. Errors:
// invalid-option for a sheet that is too large, or an image that is shown for too long.
Status begin_series(TaskRun& run, const std::vector<double>& durations_s,
                    const RenderOptions& options);

// Views from options.render.turntable sides of the grid.
ImageSeries turntable_series(TaskRun& run, const std::filesystem::path& container,
                             const std::string& key, const RequestOptions& options);
// Views of each frame by one camera, which frames the box of all grids. `sequence` must outlive
// them.
ImageSeries frame_series(TaskRun& run, const MadeSequence& sequence, const RequestOptions& options);
// The camera of frame_series() as RenderOptions::matrix; a matrix of the request stays.
RenderOptions frame_camera(const GridSpec& spec, const RequestOptions& options);

// Lists one image as the result.
Status write_image(TaskRun& run, const RenderImage& image);
// Takes all images and lists them as the result, in the request's kind. Each is encoded while the
// next one is drawn. Errors: those of the images and of begin_series().
Status write_series(TaskRun& run, const ImageSeries& series, const RenderOptions& options);

}  // namespace voxeld
