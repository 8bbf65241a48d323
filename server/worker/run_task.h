// Runs one task.
#pragma once

#include <filesystem>

#include "proto/messages/task_api.h"
#include "server/worker/device_slice.h"
#include "server/worker/engine.h"
#include "server/worker/task_monitor.h"

namespace voxeld {

// Reads the input, computes, and writes the outputs to `scratch`. `time slices` gives time slices
// of the device; null if this worker has the device to itself.
//
// Errors: those of loading, voxelizing, rendering and encoding; cancelled; grid-too-large if memory
// runs out. The completion of a preempted task (monitor.is_preempted()) has timings and no outputs.
Result<TaskCompletion> run_task(Engine& engine, const Task& task,
                                const std::filesystem::path& scratch, TaskMonitor& monitor,
                                SliceClient* slices = nullptr);

}  // namespace voxeld
