#include "server/jobs/workers/output_adopter.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

#include "proto/container/grid_directory.h"
#include "server/base/clock.h"
#include "server/base/disk/file.h"
#include "server/base/log.h"
#include "server/jobs/model/caller.h"
#include "server/jobs/model/job_record.h"
#include "server/jobs/model/tenant_limits.h"
#include "server/jobs/workers/scratch_watch.h"

namespace voxeld {

namespace fs = std::filesystem;

namespace {

// Tiles of a native container. Errors: those of GridDirectory.
Result<int64_t> tile_count(const fs::path& container) {
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(container));
  VOXELD_ASSIGN(const GridDirectory directory, GridDirectory::open(file.bytes()));
  return static_cast<int64_t>(directory.tile_count());
}

}  // namespace

OutputAdopter::Terms OutputAdopter::terms_of(std::string_view task) {
  const auto record = context_.jobs.get(Caller::daemon(), task, JobTexts::kBrief);
  Terms terms;
  if (!record) return terms;
  if (config_.limits_of) terms.limits = config_.limits_of(record->tenant);
  if (record->transient) terms.durability = Durability::kSoon;
  return terms;
}

Status OutputAdopter::adopt_outputs(const WorkerFiles& files, const TaskCompletion& completion,
                                    std::map<std::string, BlobInfo>& adopted,
                                    FinishedTask& finished) {
  VOXELD_TRY(check_scratch(files.written(), config_.limits.scratch_bytes_max));
  JobResult& result = finished.result;
  result.meta_json = completion.meta_json;
  result.warnings = completion.warnings;
  for (const TaskOutput& output : completion.outputs) {
    if (!adopted.contains(output.path)) {  // a native result is its own grid: one file, two roles
      VOXELD_ASSIGN(const fs::path taken, files.take(output.path));
      VOXELD_ASSIGN(adopted[output.path], context_.blobs.adopt(taken, finished.durability));
    }
    const BlobInfo& blob = adopted[output.path];
    if (output.role == "grid") {
      result.grid = blob.id;
      finished.grid_bytes = blob.bytes;
    }
    if (output.role == "sequence") {
      result.sequence = blob.id;
      finished.sequence_bytes = blob.bytes;
    }
    if (output.role != "result") continue;
    result.blob = blob.id;
    result.bytes = blob.bytes;
    result.media_type = output.media_type;
    result.filename = output.filename;
  }
  return {};
}

Result<std::optional<JobRecord>> OutputAdopter::complete(const WorkerFiles& files,
                                                         TaskCompletion completion) {
  const LiveJob seen = context_.live(completion.task);
  const auto fail = [&](const Error& error) {
    files.clear();  // first, since the disk may be full of what it wrote
    return context_.jobs.fail(completion.task, completion.fence, error, seen);
  };
  const Stopwatch watch;
  std::map<std::string, BlobInfo> adopted;
  FinishedTask finished;
  finished.task = completion.task;
  finished.fence = completion.fence;
  const Terms terms = terms_of(completion.task);
  finished.bytes_max = terms.limits.bytes;
  finished.durability = terms.durability;
  if (const Status stored = adopt_outputs(files, completion, adopted, finished); !stored) {
    return fail(stored.error());
  }
  if (const std::string& sequence = finished.result.sequence; !sequence.empty()) {
    const auto frames = context_.frames.check(completion.task, sequence);
    if (!frames) return fail(frames.error());
    finished.frames = *frames;
  }
  add_stage(completion.timings, "store", watch.ms());
  finished.timings = std::move(completion.timings);
  auto ended = context_.jobs.complete(finished, seen);
  if (!ended) return fail(ended.error());
  if (*ended && (*ended)->status.error) {  // more than its tenant may keep
    std::vector<std::string> ids;
    ids.reserve(adopted.size());
    for (const auto& [path, blob] : adopted) ids.push_back(blob.id);
    adopted.clear();  // lets go of them
    if (const Status removed = context_.assets.remove_unnamed(ids); !removed) {
      log::warn("cannot remove what a tenant may not keep", {{"error", removed.error().message()}});
    }
  }
  return ended;
}

Result<std::optional<BlobInfo>> OutputAdopter::add_frame(const WorkerFiles& files,
                                                         const TaskFrame& frame,
                                                         int64_t frames_total) {
  VOXELD_TRY(check_scratch(files.written(), config_.limits.scratch_bytes_max));
  VOXELD_ASSIGN(const fs::path taken, files.take(frame.path));
  const Terms terms = terms_of(frame.task);
  VOXELD_ASSIGN(BlobInfo blob, context_.blobs.adopt(taken, terms.durability));
  // The first frames of a job may come before its first progress.
  const int64_t total = std::max(frame.frames_total, frames_total);
  std::string replaced;
  auto listed = context_.frames.add(frame, blob, total, terms.limits.bytes, &replaced);
  if (!replaced.empty()) context_.blobs.suspect(std::move(replaced));
  if (!listed) {
    const std::string id = blob.id;
    blob = {};  // lets go of it
    VOXELD_TRY(context_.assets.remove_unnamed({id}));
    return std::move(listed).error();
  }
  if (!*listed) return std::optional<BlobInfo>();
  context_.board.frames_listed(frame.task, **listed);
  context_.metrics.frame_done();
  return std::optional(std::move(blob));
}

Status OutputAdopter::check_parts(const TaskPart& part, const fs::path& file) {
  const int64_t bytes_max = config_.limits.scratch_bytes_max;
  std::error_code failed;
  const auto bytes = static_cast<int64_t>(fs::file_size(file, failed));
  if (failed) return code_error("stat", file, failed);
  const int64_t all = context_.parts.bytes_before(part.task, part.position) + bytes;
  if (bytes_max == 0 || all <= bytes_max) return {};
  return Error{ErrorCode::kStorageFull, "the parts of a job take more than one worker may write",
               "at most " + std::to_string(bytes_max) + " bytes", std::to_string(all)};
}

Status OutputAdopter::add_part(const WorkerFiles& files, const TaskPart& part) {
  VOXELD_ASSIGN(const fs::path taken, files.take(part.path));
  Status kept = [&]() -> Status {
    VOXELD_TRY(context_.disk.for_data());
    VOXELD_TRY(check_parts(part, taken));
    VOXELD_ASSIGN(const int64_t tiles, tile_count(taken));
    return context_.parts.add(part.task, part.position, tiles, taken);
  }();
  if (kept) {
    context_.board.tiles_kept(part.task);
  } else {
    ::unlink(taken.c_str());  // the task goes on, perhaps for hours
  }
  return kept;
}

}  // namespace voxeld
