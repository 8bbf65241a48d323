// Tasks that draw meshes, grids and sequences.
#pragma once

#include "server/worker/task/task_run.h"

namespace voxeld {

// asset, grid or sequence -> one image, or the images of all frames or views in one file. Meta:
// width, height (of one image), images if there are several, and the meta of intermediate
// results. Stages: those of intermediate results; render, encode. Errors: theirs; invalid-option
// for images that the input cannot give.
Status render(TaskRun& run);

}  // namespace voxeld
