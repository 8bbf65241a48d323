// A mesh as the input of a task: from the cache, from one upload, or from the uploads of a bundle.
#pragma once

#include <memory>
#include <string>

#include "server/scene/animated_scene.h"
#include "server/worker/task_run.h"

namespace voxeld {

// What of the input decides the scene: its bytes, and the file name where that names the format.
std::string scene_key(const Task& task, bool decode_images);

// The asset as a scene, from the cache where it is the same as last time. Adds the loader's
// warnings to the completion. Stage: parse.
Result<std::shared_ptr<const Scene>> load_input_scene(TaskRun& run, bool decode_images);
// The same with what moves it.
Result<std::shared_ptr<const AnimatedScene>> load_input_animated(TaskRun& run, bool decode_images);

}  // namespace voxeld
