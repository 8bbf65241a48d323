// Runs one task.
#pragma once

#include <filesystem>

#include "proto/task_api.h"
#include "server/worker/device_turn.h"
#include "server/worker/engine.h"
#include "server/worker/task_monitor.h"

namespace voxeld {

// Reads the input, computes, and writes the outputs to `scratch`. `turns` gives time slices of the
// device; null if this worker has the device to itself.
//
// Errors: those of loading, voxelizing, rendering and encoding; cancelled; grid-too-large if memory
// runs out. The completion of a preempted task (monitor.is_parked()) has timings and no outputs.
Result<TaskCompletion> run_task(Engine& engine, const Task& task,
                                const std::filesystem::path& scratch, TaskMonitor& monitor,
                                TurnClient* turns = nullptr);

}  // namespace voxeld
