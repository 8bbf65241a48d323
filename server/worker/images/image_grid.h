// The grid from which an image is drawn: the whole grid if it fits. Otherwise the tiles in view, at
// a level of detail whose voxels are small in the image, or that fits.
#pragma once

#include <memory>
#include <string>

#include "proto/options/options.h"
#include "server/grid/tile_source.h"
#include "server/worker/task/task_run.h"

namespace voxeld {

struct ImageGrid {
  std::shared_ptr<const LoadedGrid> grid;
  std::string key;        // of the grid that the renderer holds
  RenderOptions options;  // the request's, with the camera of the whole grid
};

// `source_key` is the grid's name. `whole` is the grid if it is in memory already. The drawn grid
// stays in the cache for the next image of the same tiles at the same level. Meta: drawn {level,
// tiles, tiles_in_grid, voxels}. Stage: parse. Errors: the source's; invalid-option for a region
// outside the grid.
Result<ImageGrid> image_grid(TaskRun& run, const TileSource& source, const std::string& source_key,
                             const std::shared_ptr<const LoadedGrid>& whole,
                             const RequestOptions& options);

}  // namespace voxeld
