// How a task ended, as its worker tells the gateway.
#pragma once

#include <variant>

#include "proto/messages/task_api.h"

namespace voxeld {

// No report is awaited any more: another worker owns the task, or the gateway is gone.
struct TaskDropped {};

using TaskOutcome = std::variant<TaskCompletion, TaskPreemption, TaskFailure, TaskDropped>;

}  // namespace voxeld
