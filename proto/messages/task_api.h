// The task API: how a worker asks the gateway for work and reports on it. Each message is one JSON
// object in a frame: u32 little-endian byte count (at most kTaskFrameBytesMax), then the text. The
// worker sends a request, the gateway sends one reply; locally over a Unix socket, with
// blobs passed as file paths in the data directory.
//
//   worker                                gateway
//   prepare {}                       ->   {scratch_dir, input_dir, cache_dir,
//                                          disk_reserve_bytes}   (optional)
//   hello {protocol, pid, device}    ->   {ok, scratch_dir}
//   claim {}                         ->   {task: Task}            (blocks until there is one)
//   progress {task, fence, …}        ->   {cancel: bool, fenced: bool, preempt: bool}
//   frame {task, fence, frame…}      ->   {cancel, fenced, grid, path}
//   part {task, fence, part…}        ->   {cancel, fenced, error}
//   complete {task, fence, outputs…} ->   {ok} | {fenced}
//   preempt {task, fence, …}            ->   {ok} | {fenced}
//   fail {task, fence, error}        ->   {ok} | {fenced}
//
// A device works for one task at a time. Each worker asks for time slices of it on a second
// connection, so waiting for one does not block the messages above:
//
//   time slices {protocol, pid, device}    ->   {ok}
//   slice_take {task, fence, bytes…}  ->   SliceReply               (blocks until it is its turn)
//   slice_renew {task, fence}         ->   SliceReply               (gives it back, takes the next)
//   slice_give {task, fence}          ->   (no reply)
//
// The gateway measures how long a time slice was held: a worker that a hostile file has taken over
// cannot report less. A connection that ends gives its time slice back.
//
// A preempted worker hands over its finished parts or frames (part, frame) at the next tile or
// frame and gives the task back with `preempt`. The task is queued again and goes on from there
// later.
//
// A worker that receives `fenced` drops the task: another worker owns it. A connection that ends
// means that the worker died, and its task is queued again at once.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "proto/messages/job.h"
#include "proto/result.h"

namespace voxeld {

inline constexpr int kTaskProtocolVersion = 1;
inline constexpr uint32_t kTaskFrameBytesMax = 16u << 20;
// The most parts of a job; the gateway asks for no more.
inline constexpr int64_t kPartsMax = 4096;

struct WorkerHello {
  int protocol = kTaskProtocolVersion;
  int64_t pid = 0;
  std::string device;       // as asked for: "llvmpipe", "egl:0"
  std::string renderer;     // GL_RENDERER
  std::string driver;       // GL_VERSION
  std::string device_json;  // object: limits, for /readyz, metrics and grid-too-large
  std::string sandbox;      // "full", "off", or what is missing; empty: not reported
  // The parts of the device that failed the self-test and are not used; empty: all are used. They
  // are in this message, so that /readyz never shows such a worker as one without faults.
  std::string device_failure;
};

// Folders that a worker may access. It asks for them before it opens its device, because its
// sandbox gives up all other files then.
struct WorkerFolders {
  std::string scratch_dir;         // for outputs
  std::string input_dir;           // holds the inputs that tasks name, read-only
  std::string cache_dir;           // of drivers; deleted with the worker
  int64_t disk_reserve_bytes = 0;  // that must stay free on the disk of scratch_dir; 0: none
};

// A frame that an earlier attempt at the job left in the store.
struct TaskDoneFrame {
  std::string grid;  // id of its container
  std::string path;  // path of the container, read-only
  double time_s = 0;
  uint64_t voxel_count = 0;
  std::string content_hash;
};

// One attempt at one job.
struct Task {
  std::string id;     // job id
  int64_t fence = 0;  // grows with each claim of the job; reports with an older one are void
  int attempt = 1;
  JobKind kind = JobKind::kVoxelize;
  std::string input_path;  // the asset's, grid's or sequence's blob, read-only
  std::string input_hash;  // "sha256-…"
  bool input_is_grid = false;
  bool input_is_sequence = false;
  // The containers of a sequence's frames in their order, read-only.
  std::vector<std::string> frame_paths;
  // Paths of a bundle's files that were uploaded one by one (proto/messages/bundle_manifest.h), in
  // the order of the manifest.
  std::vector<std::string> bundle_paths;
  std::string filename;
  std::string options_json;  // canonical JSON in the scope of the kind
  // Results of earlier attempts at the job, read-only: its first tiles in their order, and its
  // first frames. The worker goes on after them.
  std::vector<std::string> part_paths;
  std::vector<TaskDoneFrame> done_frames;
  // The tenant of the task. A worker's cache must not serve another tenant: the time saved would
  // reveal that someone else has the same input.
  std::string tenant;
  // Ids of the request that created the job, for the log.
  std::string request_id, trace_id;
  int64_t cells_max = 0;  // cells of all frames that the tenant may make in one job; 0: no limit
};

// role: "result" (the response's bytes), "grid" (the native container), "sequence" (its manifest).
struct TaskOutput {
  std::string role;
  // A plain, closed file in scratch_dir. The gateway hashes, syncs and moves it into the store.
  std::string path;
  std::string media_type;
  std::string filename;
};

struct DeviceMemory {
  int64_t bytes_total = 0, bytes_free = 0;  // 0, 0: the driver does not report it
};

struct TaskProgress {
  std::string task;
  int64_t fence = 0;
  std::string stage;
  int64_t tiles_done = 0, tiles_total = 0;
  int64_t frames_done = 0, frames_total = 0;
  DeviceMemory device_memory;
  // The task has advanced beyond its starting point and would lose next to nothing if preempted.
  bool is_preemptible = false;
  // Time of the preparation, which another worker would have to repeat; 0 before it is known.
  int64_t preparation_ms = 0;
};
struct TaskProgressReply {
  bool cancel = false;
  bool fenced = false;
  bool preempt = false;  // preempt: another tenant needs the worker more
};

// A finished frame. The gateway moves its container into the store at once: it can be fetched while
// the task runs, and stays if the task is cancelled.
struct TaskFrame {
  std::string task;
  int64_t fence = 0;
  int64_t index = 0;  // among the request's frames
  double time_s = 0;
  std::string path;  // in scratch_dir: a native container
  uint64_t voxel_count = 0;
  std::string content_hash;
  int64_t frames_total = 0;  // of the request; 0: the number that progress reports
};
struct TaskFrameReply {
  bool cancel = false;
  bool fenced = false;
  std::string grid;  // id of the container
  std::string path;  // its path in the store, read-only
};

// Finished tiles of one grid, after those of the parts before. The gateway keeps the container,
// whose meta says how far the tiles reach, until the job ends. A later attempt goes on from there.
struct TaskPart {
  std::string task;
  int64_t fence = 0;
  int64_t position = 0;  // among the job's parts; replaces the parts at and after it
  std::string path;      // in scratch_dir: a native container
};
struct TaskPartReply {
  bool cancel = false;
  bool fenced = false;
  std::string error;  // why the part was not stored; empty: it was stored
};

struct TaskCompletion {
  std::string task;
  int64_t fence = 0;
  std::vector<TaskOutput> outputs;
  StageTimes timings;
  std::string meta_json = "{}";
  std::vector<Warning> warnings;
};
// The task was preempted and the gateway has all its work. Sent only on request.
struct TaskPreemption {
  std::string task;
  int64_t fence = 0;
  int64_t tiles_done = 0, tiles_total = 0;  // 0, 0 for a sequence: its frames are listed
  StageTimes timings;                       // of this attempt
};
struct TaskFailure {
  std::string task;
  int64_t fence = 0;
  Error error;
};

// The first message of a connection for time slices.
struct SlicesHello {
  int protocol = kTaskProtocolVersion;
  int64_t pid = 0;
  std::string device;
};
enum class SliceAction { kTake, kRenew, kGive };
struct SliceRequest {
  SliceAction action = SliceAction::kTake;
  std::string task;
  int64_t fence = 0;
  // Upper estimates of the memory that the task needs until its end, including what its process has
  // already. Sent with kTake; only those of a task's first time slice count.
  int64_t host_bytes = 0, device_bytes = 0;
};
struct SliceReply {
  bool granted = false;
  bool cancel = false;         // nobody wants the task's result any more
  bool fenced = false;         // another worker owns the task
  std::optional<Error> error;  // no time slice is possible: the task fails with this error
};

// Parses a frame of the socket, of at most kTaskFrameBytesMax. The limit exceeds that of a
// request's body, because the paths of a long sequence need more. Errors: as parse_json_bounded().
Result<nlohmann::json> parse_task_message(std::string_view text);

nlohmann::json to_json_message(const WorkerHello& hello);
nlohmann::json to_json_message(const WorkerFolders& folders);
nlohmann::json to_json_message(const Task& task);
nlohmann::json to_json_message(const TaskProgress& progress);
nlohmann::json to_json_message(const TaskProgressReply& reply);
nlohmann::json to_json_message(const TaskFrame& frame);
nlohmann::json to_json_message(const TaskFrameReply& reply);
nlohmann::json to_json_message(const TaskPart& part);
nlohmann::json to_json_message(const TaskPartReply& reply);
nlohmann::json to_json_message(const TaskCompletion& completion);
nlohmann::json to_json_message(const TaskPreemption& preempt);
nlohmann::json to_json_message(const TaskFailure& failure);
nlohmann::json to_json_message(const SlicesHello& hello);
nlohmann::json to_json_message(const SliceRequest& request);
nlohmann::json to_json_message(const SliceReply& reply);
Result<SlicesHello> parse_slices_hello(const nlohmann::json& message);
Result<SliceRequest> parse_slice_request(const nlohmann::json& message);
Result<SliceReply> parse_slice_reply(const nlohmann::json& message);
Result<WorkerHello> parse_worker_hello(const nlohmann::json& message);
Result<WorkerFolders> parse_worker_folders(const nlohmann::json& message);
Result<Task> parse_task(const nlohmann::json& message);
Result<TaskProgress> parse_task_progress(const nlohmann::json& message);
Result<TaskProgressReply> parse_task_progress_reply(const nlohmann::json& message);
Result<TaskFrame> parse_task_frame(const nlohmann::json& message);
Result<TaskFrameReply> parse_task_frame_reply(const nlohmann::json& message);
Result<TaskPart> parse_task_part(const nlohmann::json& message);
Result<TaskPartReply> parse_task_part_reply(const nlohmann::json& message);
Result<TaskCompletion> parse_task_completion(const nlohmann::json& message);
Result<TaskPreemption> parse_task_preempt(const nlohmann::json& message);
Result<TaskFailure> parse_task_failure(const nlohmann::json& message);

}  // namespace voxeld
