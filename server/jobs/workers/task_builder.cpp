#include "server/jobs/workers/task_builder.h"

#include <cstdint>
#include <filesystem>
#include <utility>
#include <vector>

#include "server/jobs/records/blob_needs.h"

namespace voxeld {

// The blob is verified first, once per process.
Result<std::string> TaskBuilder::hand_over(std::string_view id, std::string_view what) {
  const bool is_asset = what == "asset";
  VOXELD_ASSIGN(const BlobInfo blob,
                named_blob(context_.blobs, id, "the " + std::string(what) + " " + std::string(id),
                           is_asset ? "upload the same bytes again, then submit the job again"
                                    : "submit the job that made it again"));
  VOXELD_ASSIGN(const std::filesystem::path file, context_.blobs.local_file(blob.id));
  return files_.hand_over(file);
}

Result<Task> TaskBuilder::build(const JobRecord& record) {
  const JobStatus& status = record.status;
  Task task;
  task.id = status.id;
  task.fence = record.fence;
  task.attempt = status.attempt;
  task.kind = status.kind;
  task.input_is_grid = !status.grid.empty();
  task.input_is_sequence = !status.sequence.empty();
  task.input_hash = task.input_is_grid       ? status.grid
                    : task.input_is_sequence ? status.sequence
                                             : status.asset;
  VOXELD_ASSIGN(task.input_path, hand_over(task.input_hash, task.input_is_grid       ? "grid"
                                                            : task.input_is_sequence ? "sequence"
                                                                                     : "asset"));
  task.filename = status.filename;
  task.options_json = status.options_json;
  task.tenant = record.tenant;
  if (config_.limits_of) task.cells_max = config_.limits_of(record.tenant).cells;
  task.request_id = record.request_id;
  task.trace_id = record.trace_id;
  if (task.input_is_sequence) {
    VOXELD_ASSIGN(const SequenceManifest manifest, context_.frames.read_blob(status.sequence));
    for (const SequenceFrame& frame : manifest.frames) {
      VOXELD_ASSIGN(task.frame_paths.emplace_back(), hand_over(frame.grid, "grid"));
    }
  }
  if (!status.asset.empty()) {
    VOXELD_ASSIGN(const auto bundled,
                  context_.assets.bundle_files(record.asset_tenant, status.asset));
    for (const BundleFile& file : bundled) {
      VOXELD_ASSIGN(task.bundle_paths.emplace_back(), hand_over(file.asset, "asset"));
    }
  }
  VOXELD_TRY(add_done(record, task));
  return task;
}

// Adds the work of earlier attempts: parts, and frames from the first one on.
Status TaskBuilder::add_done(const JobRecord& record, Task& task) {
  for (const std::filesystem::path& part : context_.parts.of_job(task.id)) {
    VOXELD_ASSIGN(task.part_paths.emplace_back(), files_.hand_over(part));
  }
  if (record.status.frames_total == 0) return {};
  VOXELD_ASSIGN(const std::vector<ListedFrame> frames, context_.frames.of_job(task.id));
  for (const ListedFrame& listed : frames) {
    const SequenceFrame& frame = listed.frame;
    const bool follows = listed.index == static_cast<int64_t>(task.done_frames.size());
    if (!follows || !context_.blobs.verified(frame.grid)) break;
    VOXELD_ASSIGN(const std::filesystem::path file, context_.blobs.local_file(frame.grid));
    VOXELD_ASSIGN(std::string path, files_.hand_over(file));
    task.done_frames.push_back(
        {frame.grid, std::move(path), frame.time_s, frame.voxel_count, frame.content_hash});
  }
  return {};
}

}  // namespace voxeld
