// What of a grid a picture is drawn from: all of it where that fits; else the tiles in view, at a
// level of detail whose voxels are small in the picture, or that fits.
#pragma once

#include <memory>
#include <string>

#include "proto/options.h"
#include "server/grid/tile_source.h"
#include "server/worker/task_run.h"

namespace voxeld {

struct PictureGrid {
  std::shared_ptr<const LoadedGrid> grid;
  std::string key;        // of what the renderer holds
  RenderOptions options;  // the request's, with the camera of the whole grid
};

// `source_key`: the grid's name. `whole`: all of the grid, where it is in memory already. The grid
// that is drawn stays in the cache, and the next picture of the same tiles at the same level takes
// it from there. Meta: drawn {level, tiles, tiles_in_grid, voxels}. Stage: parse. Errors: the
// source's; invalid-option for a region that is not in the grid.
Result<PictureGrid> picture_grid(TaskRun& run, const TileSource& source,
                                 const std::string& source_key,
                                 const std::shared_ptr<const LoadedGrid>& whole,
                                 const RequestOptions& options);

}  // namespace voxeld
