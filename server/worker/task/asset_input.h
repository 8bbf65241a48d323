// The mesh of a task: from the cache, from one upload, or from the uploads of a bundle.
#pragma once

#include <memory>
#include <string>

#include "proto/options/options.h"
#include "server/scene/core/animated_scene.h"
#include "server/scene/core/loaders.h"
#include "server/worker/task/task_run.h"

namespace voxeld {

// The parts of the input that decide the scene: its bytes, and the file name, which may name the
// format.
std::string scene_key(const Task& task, bool decode_images);

// Loads the asset as a scene, or takes it from the cache if it is that of the last task. Adds the
// loader's warnings to the completion. Stage: parse.
Result<std::shared_ptr<const Scene>> load_input_scene(TaskRun& run, const LoadOptions& options);
// Loads the scene with its rig.
Result<std::shared_ptr<const AnimatedScene>> load_input_animated(TaskRun& run,
                                                                 const LoadOptions& options);
// Loads an asset with the images and the variant that a request needs.
LoadOptions load_options(const VoxelizeOptions& options);

}  // namespace voxeld
