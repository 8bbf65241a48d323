// Runs one task.
#pragma once

#include <filesystem>

#include "proto/messages/task_api.h"
#include "server/worker/gateway/device_slice.h"
#include "server/worker/gateway/task_monitor.h"
#include "server/worker/gateway/task_outcome.h"
#include "server/worker/task/engine.h"

namespace voxeld {

// Reads the input, computes, and writes the outputs to `scratch`. `slices` gives time slices of the
// device; null if this worker has the device to itself.
//
// Failures: those of loading, voxelizing, rendering and encoding; cancelled; grid-too-large if
// memory runs out; internal for a result that the task API cannot carry (check_bounds()).
TaskOutcome run_task(Engine& engine, const Task& task, const std::filesystem::path& scratch,
                     TaskMonitor& monitor, SliceClient* slices = nullptr);

}  // namespace voxeld
