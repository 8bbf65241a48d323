#include "server/worker/task/task_run.h"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <utility>

#include "proto/messages/bundle_manifest.h"
#include "server/base/cancel_point.h"
#include "server/base/disk/file.h"
#include "server/worker/mesh/inspect.h"

namespace voxeld {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

// Warnings listed. A hostile mesh can cause any number of them.
constexpr size_t kWarningsMax = 100;

// "models/bunny.ply" -> "bunny"; "bundle.zip!a/spot.obj" -> "spot"; "" -> "voxels". The name of a
// result has no control characters (proto/messages/task_fields.h); that of an upload may.
std::string output_stem(const std::string& filename) {
  const size_t member = filename.rfind('!');
  const std::string name = member == std::string::npos ? filename : filename.substr(member + 1);
  const bool is_bundle = name.ends_with(kBundleExtension);
  std::string stem = is_bundle ? name.substr(0, name.size() - kBundleExtension.size())
                               : fs::path(name).stem().string();
  const auto is_control = [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; };
  std::ranges::replace_if(stem, is_control, '_');
  return stem.empty() ? "voxels" : stem;
}

}  // namespace

Result<RequestOptions> task_options(const Task& task, OptionScope scope) {
  VOXELD_ASSIGN(const json object, parse_json_bounded(task.options_json));
  return parse_options(object, scope);
}

TileProgress progress_of(TaskRun& run) {
  return [&run](int64_t done, int64_t total) {
    return run.monitor.set_progress(done, total) && !is_cancelled();
  };
}

Error preempt(TaskRun& run) {
  const TaskProgress reached = run.monitor.progress();
  const bool has_frames = reached.frames_total > 0;
  run.preempted = TaskPreemption{run.task.id,
                                 run.task.fence,
                                 has_frames ? 0 : reached.tiles_done,
                                 has_frames ? 0 : reached.tiles_total,
                                 {}};
  return Error{ErrorCode::kCancelled, "the job was preempted", "", ""};
}

fs::path next_output(const TaskRun& run) {
  return run.scratch / (run.task.id + "-" + std::to_string(run.completion.outputs.size()));
}

void list_output(TaskRun& run, const fs::path& path, std::string_view roles,
                 std::string_view media_type, std::string_view extension) {
  while (!roles.empty()) {
    const std::string_view role = roles.substr(0, roles.find(' '));
    roles.remove_prefix(std::min(role.size() + 1, roles.size()));
    run.completion.outputs.push_back({std::string(role), path.string(), std::string(media_type),
                                      output_stem(run.task.filename) + std::string(extension)});
  }
}

Status add_output(TaskRun& run, std::string_view roles, std::span<const uint8_t> bytes,
                  std::string_view media_type, std::string_view extension) {
  const fs::path path = next_output(run);
  VOXELD_TRY(write_file(path, bytes));
  list_output(run, path, roles, media_type, extension);
  return run.monitor.check();
}

void add_warnings(TaskRun& run, const std::vector<Warning>& warnings) {
  for (const Warning& warning : warnings) {
    if (run.completion.warnings.size() > kWarningsMax) return;
    if (run.completion.warnings.size() == kWarningsMax) {
      run.completion.warnings.push_back(
          {"more-warnings", "the first " + std::to_string(kWarningsMax) + " are listed"});
      return;
    }
    run.completion.warnings.push_back({warning.code, warning.detail.substr(0, kWarningBytesMax)});
  }
}

void add_meta(TaskRun& run, const json& facts) {
  if (facts.is_object()) run.meta.update(facts);
}

std::string meta_text(const TaskRun& run) {
  return run.meta.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace voxeld
