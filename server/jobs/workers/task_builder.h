// Makes the task that a worker is told, from the record of a job: its inputs are handed over to the
// worker's folder, with the work of earlier attempts.
#pragma once

#include <string>
#include <string_view>

#include "proto/messages/task_api.h"
#include "server/jobs/workers/task_context.h"
#include "server/jobs/workers/worker_files.h"

namespace voxeld {

// For one worker, on its session's thread.
class TaskBuilder {
 public:
  // All of them outlive it.
  TaskBuilder(const TaskServerConfig& config, const TaskServerContext& context,
              const WorkerFiles& files)
      : config_(config), context_(context), files_(files) {}

  // Errors: gone for an input that is not stored any more or is damaged, with the remedy; internal.
  Result<Task> build(const JobRecord& record);

 private:
  // The path by which the worker finds an input.
  Result<std::string> hand_over(std::string_view id, std::string_view what);
  Status add_done(const JobRecord& record, Task& task);

  const TaskServerConfig& config_;
  const TaskServerContext& context_;
  const WorkerFiles& files_;
};

}  // namespace voxeld
