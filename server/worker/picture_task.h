// The stories of tasks that draw: of meshes, grids and sequences.
#pragma once

#include "server/worker/task_run.h"

namespace voxeld {

// asset, grid or sequence -> one picture, or the pictures of all frames or views in one file.
// Meta: width, height (of one picture), pictures where there are several, and those of what is
// made on the way. Stages: those of what is made; render, encode. Errors: theirs; invalid-option
// for pictures that the input cannot give.
Status render(TaskRun& run);

}  // namespace voxeld
