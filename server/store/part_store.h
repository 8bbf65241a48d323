// Finished tiles of jobs that have not ended: DIR/parts/JOB/POSITION.sha256-…, native containers as
// workers handed them over (TaskPart). They are a job's own until it ends, and nobody can ask for
// them; what makes a part void is found when it is read, so no database names them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"

namespace voxeld {

// Thread-safe as long as one thread at a time works on a job, the one whose worker has it.
class PartStore {
 public:
  // Makes the directory.
  static Result<PartStore> open(const std::filesystem::path& root);

  // Hashes, syncs and moves a worker's file to its place. Parts that were at and after the position
  // go. Errors: internal for what is not a plain file, storage-full.
  Status add(std::string_view job, int64_t position, const std::filesystem::path& file) const;
  // The job's parts from the first one on, as far as they are all there and have the bytes that
  // were added.
  std::vector<std::filesystem::path> of_job(std::string_view job) const;
  // Costs next to nothing where there are none.
  void remove(std::string_view job) const;
  // At start: those of jobs that are not `wanted` any more.
  void remove_unless(const std::function<bool(std::string_view job)>& wanted) const;

 private:
  explicit PartStore(std::filesystem::path folder) : folder_(std::move(folder)) {}
  std::filesystem::path folder_;
};

}  // namespace voxeld
