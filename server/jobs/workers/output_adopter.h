// Takes the files that workers leave into the store: they become blobs, and rows name them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "proto/messages/task_api.h"
#include "server/jobs/workers/task_context.h"
#include "server/jobs/workers/worker_files.h"

namespace voxeld {

// Thread-safe; holds no state of its own.
class OutputAdopter {
 public:
  // Both outlive it.
  OutputAdopter(const TaskServerConfig& config, const TaskServerContext& context)
      : config_(config), context_(context) {}

  // Stores what a worker made and ends the job: done, or failed when that cannot be stored. nullopt
  // when another worker owns the job by now.
  Result<std::optional<JobRecord>> complete(const WorkerFiles& files, TaskCompletion completion);
  // Stores and lists a frame of a sequence that has `frames_total` ones, as the worker last said.
  // nullopt as above. Errors: storage-full, quota-exceeded, internal.
  Result<std::optional<BlobInfo>> add_frame(const WorkerFiles& files, const TaskFrame& frame,
                                            int64_t frames_total);
  // Keeps a part of a grid for the job's next attempt. All of a job's parts may take as much as one
  // worker may write. Errors: storage-full, internal.
  Status add_part(const WorkerFiles& files, const TaskPart& part);

 private:
  Status check_parts(const TaskPart& part, const std::filesystem::path& file);
  // `adopted` keeps them in the store until the database names them.
  Status adopt_outputs(const WorkerFiles& files, const TaskCompletion& completion,
                       std::map<std::string, BlobInfo>& adopted, FinishedTask& finished);
  // The limits of the job's tenant, and the durability of the outputs.
  struct Terms {
    TenantLimits limits;
    Durability durability = Durability::kNow;
  };
  Terms terms_of(std::string_view task);

  const TaskServerConfig& config_;
  const TaskServerContext& context_;
};

}  // namespace voxeld
