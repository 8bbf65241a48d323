// The completion of a task, or why there is none.
#pragma once

#include <utility>
#include <variant>

#include "server/worker/gateway/task_outcome.h"

namespace voxeld::testing {

inline Result<TaskCompletion> completion_of(TaskOutcome outcome) {
  if (auto* done = std::get_if<TaskCompletion>(&outcome)) return std::move(*done);
  if (auto* failure = std::get_if<TaskFailure>(&outcome)) return std::move(failure->error);
  const bool preempted = std::holds_alternative<TaskPreemption>(outcome);
  return Error{ErrorCode::kInternal, preempted ? "preempted" : "dropped", "", ""};
}

}  // namespace voxeld::testing
