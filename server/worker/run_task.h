// The story of one task.
#pragma once

#include <filesystem>

#include "proto/task_api.h"
#include "server/worker/device_turn.h"
#include "server/worker/engine.h"
#include "server/worker/task_monitor.h"

namespace voxeld {

// `turns` on the device where others use it, too; null where it is this worker's alone.
//
// Reads the input, computes, and writes the outputs to `scratch`. Errors: those of loading,
// voxelizing, rendering and encoding; cancelled; grid-too-large when memory runs out. Of a task
// that was parked (monitor.is_parked()) the completion has timings and no outputs.
Result<TaskCompletion> run_task(Engine& engine, const Task& task,
                                const std::filesystem::path& scratch, TaskMonitor& monitor,
                                TurnClient* turns = nullptr);

}  // namespace voxeld
