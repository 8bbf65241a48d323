// The state of a running task and what each of its steps adds to the result.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "proto/messages/task_api.h"
#include "proto/options/options.h"
#include "server/base/clock.h"
#include "server/worker/gateway/device_slice.h"
#include "server/worker/gateway/task_monitor.h"
#include "server/worker/task/engine.h"

namespace voxeld {

struct TaskRun {
  Engine& engine;
  const Task& task;
  const std::filesystem::path& scratch;
  TaskMonitor& monitor;
  TaskCompletion completion;  // filled in step by step, except its meta
  DeviceSlice slice;          // for passes over the device; not for reading and encoding
  nlohmann::json meta = nlohmann::json::object();
  std::optional<TaskPreemption> preempted = std::nullopt;  // once the task is preempted
};

// Measures one stage and reports it to the monitor.
class StageTimer {
 public:
  StageTimer(TaskRun& run, std::string_view stage) : run_(run), stage_(stage) {
    run_.monitor.set_stage(stage);
  }
  ~StageTimer() { add_stage(run_.completion.timings, stage_, watch_.ms()); }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  TaskRun& run_;
  const std::string stage_;
  const Stopwatch watch_;
};

Result<RequestOptions> task_options(const Task& task, OptionScope scope);

// Reports tiles and gives way to other tasks between them. `run` must outlive it.
TileProgress progress_of(TaskRun& run);
// Preempts the task after its work was handed over: it ends here and is queued again. Always
// returns the error cancelled, on which the task unwinds as on a cancellation.
Error preempt(TaskRun& run);

// The path of the next output in the scratch directory.
std::filesystem::path next_output(const TaskRun& run);
// Lists an existing file under `roles` (space-separated).
void list_output(TaskRun& run, const std::filesystem::path& path, std::string_view roles,
                 std::string_view media_type, std::string_view extension);
// Writes bytes to the scratch directory and lists them under `roles` (space-separated).
Status add_output(TaskRun& run, std::string_view roles, std::span<const uint8_t> bytes,
                  std::string_view media_type, std::string_view extension);

// Adds to the completion's warnings, up to a limit; one more warning reports what was omitted.
void add_warnings(TaskRun& run, const std::vector<Warning>& warnings);
// Adds the members of `facts`, an object, to the meta. Anything else adds nothing.
void add_meta(TaskRun& run, const nlohmann::json& facts);
// The meta as the completion carries it.
std::string meta_text(const TaskRun& run);

}  // namespace voxeld
