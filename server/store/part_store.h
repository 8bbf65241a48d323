// Finished tiles of running jobs: DIR/parts/JOB/POSITION.TILES.sha256-…, native containers of TILES
// tiles from workers (TaskPart). They belong to their job until it ends. A void part is detected
// when it is read, so no database lists them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"

namespace voxeld {

// A part of a job.
struct JobPart {
  std::filesystem::path path;
  int64_t first_tile = 0;  // number of tiles in the parts before it
};

// Thread-safe as long as one thread at a time changes a job's parts: the one whose worker has it.
class PartStore {
 public:
  // Makes the directory.
  static Result<PartStore> open(const std::filesystem::path& root);

  // Hashes, syncs and moves a worker's file to its place. Parts at and after the position are
  // removed. Errors: internal if it is not a plain file, storage-full.
  Status add(std::string_view job, int64_t position, int64_t tiles,
             const std::filesystem::path& file) const;
  // The job's parts from the first one on, up to a missing or damaged one.
  std::vector<std::filesystem::path> of_job(std::string_view job) const;
  // The bytes of the job's parts before a position.
  int64_t bytes_before(std::string_view job, int64_t position) const;
  // The part with tile `tile` of the job, counted over all parts; nullopt while there is none. The
  // file may be removed at any time. Its bytes are not compared with their hash.
  std::optional<JobPart> with_tile(std::string_view job, int64_t tile) const;
  // Removes the job's parts. It costs next to nothing if there are none.
  void remove(std::string_view job) const;
  // Removes, at start, parts of jobs that are no longer `wanted`.
  void remove_unless(const std::function<bool(std::string_view job)>& wanted) const;

 private:
  explicit PartStore(std::filesystem::path folder) : folder_(std::move(folder)) {}
  std::filesystem::path folder_;
};

}  // namespace voxeld
