// The task API: how a worker asks the gateway for work and reports on it. Each message is one JSON
// object in a frame: u32 little-endian byte count (at most kTaskFrameBytesMax), then the text. The
// worker sends a request, the gateway answers with one reply; locally over a Unix socket, with
// blobs passed as file paths in the data directory.
//
//   worker                                gateway
//   prepare {}                       ->   {scratch_dir, input_dir, cache_dir}   (optional)
//   hello {protocol, pid, device}    ->   {ok, scratch_dir}
//   claim {}                         ->   {task: Task}            (blocks until there is one)
//   progress {task, fence, …}        ->   {cancel: bool, fenced: bool, park: bool}
//   frame {task, fence, frame…}      ->   {cancel, fenced, grid, path}
//   part {task, fence, part…}        ->   {cancel, fenced}
//   complete {task, fence, outputs…} ->   {ok} | {fenced}
//   park {task, fence, …}            ->   {ok} | {fenced}
//   fail {task, fence, error}        ->   {ok} | {fenced}
//
// A device works for one task at a time. Its workers ask for turns on it on a second connection
// each, so that waiting for one holds up none of the above:
//
//   turns {protocol, pid, device}    ->   {ok}
//   turn_take {task, fence, bytes…}  ->   TurnReply               (blocks until it is its turn)
//   turn_renew {task, fence}         ->   TurnReply               (gives it back, takes the next)
//   turn_give {task, fence}          ->   (no reply)
//
// How long a turn was held is what the gateway measures: a worker that a hostile file has taken
// over cannot say less. A connection that ends gives its turn back.
//
// A worker that is asked to park hands over what it has done (part, frame) at the next tile or
// frame and gives the task back: it is queued again, and goes on from there later.
//
// A worker that sees `fenced` drops the task: another one owns it. A connection that ends means
// that the worker died: its task is put back at once.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "proto/job.h"
#include "proto/result.h"

namespace voxeld {

inline constexpr int kTaskProtocolVersion = 1;
inline constexpr uint32_t kTaskFrameBytesMax = 16u << 20;
// Parts of a job; more are not asked for.
inline constexpr int64_t kPartsMax = 4096;

struct WorkerHello {
  int protocol = kTaskProtocolVersion;
  int64_t pid = 0;
  std::string device;       // as asked for: "llvmpipe", "egl:0"
  std::string renderer;     // GL_RENDERER
  std::string driver;       // GL_VERSION
  std::string device_json;  // object: limits, for /readyz, metrics and grid-too-large
  std::string sandbox;      // "full", "off", or what is missing; empty: it does not say
};

// Where a worker may read and write. A worker asks for them before it opens its device, as it gives
// up all other files then.
struct WorkerFolders {
  std::string scratch_dir;  // for outputs
  std::string input_dir;    // where what tasks name lies, read-only
  std::string cache_dir;    // of drivers; goes with the worker
};

// A frame that an earlier attempt at the job left in the store.
struct TaskDoneFrame {
  std::string grid;  // id of its container
  std::string path;  // where that is, read-only
  double time_s = 0;
  uint64_t voxel_count = 0;
  std::string content_hash;
};

// One attempt at one job.
struct Task {
  std::string id;     // job id
  int64_t fence = 0;  // grows with each claim of the job; late reports with an old one are void
  int attempt = 1;
  JobKind kind = JobKind::kVoxelize;
  std::string input_path;  // the asset's, grid's or sequence's blob, read-only
  std::string input_hash;  // "sha256-…"
  bool input_is_grid = false;
  bool input_is_sequence = false;
  // Of a sequence, the containers of its frames in their order, read-only.
  std::vector<std::string> frame_paths;
  // The input is a bundle of files that were uploaded one by one (proto/bundle_manifest.h): where
  // each of them is, in the order of the manifest.
  std::vector<std::string> bundle_paths;
  std::string filename;
  std::string options_json;  // canonical JSON in the scope of the kind
  // What earlier attempts at the job left, read-only: its first tiles in their order, and its first
  // frames. The worker goes on after them.
  std::vector<std::string> part_paths;
  std::vector<TaskDoneFrame> done_frames;
  // Whose task it is. What a worker keeps between tasks must not serve another tenant's: the time
  // that it saves would tell who else has the same input.
  std::string tenant;
  // Of the request that it came with, for the log.
  std::string request_id, trace_id;
  int64_t cells_max = 0;  // cells of all its frames that the tenant may make in one job; 0: any
};

// role: "result" (the answer's bytes), "grid" (the native container), "sequence" (its manifest).
struct TaskOutput {
  std::string role;
  // In scratch_dir, a plain file that is closed; the gateway hashes, syncs and moves it into the
  // store.
  std::string path;
  std::string media_type;
  std::string filename;
};

struct DeviceMemory {
  int64_t bytes_total = 0, bytes_free = 0;  // 0, 0: the driver does not tell
};

struct TaskProgress {
  std::string task;
  int64_t fence = 0;
  std::string stage;
  int64_t tiles_done = 0, tiles_total = 0;
  int64_t frames_done = 0, frames_total = 0;
  DeviceMemory device_memory;
  // It has got further than what it went on from, and would lose next to nothing if it were parked.
  bool can_park = false;
  // What it took to get there, which another worker would need again; 0 before it is known.
  int64_t preparation_ms = 0;
};
struct TaskProgressReply {
  bool cancel = false;
  bool fenced = false;
  bool park = false;  // another tenant needs the worker more
};

// A frame that is done. The gateway takes its container into the store at once: it can be fetched
// while the task runs, and stays when the task is cancelled.
struct TaskFrame {
  std::string task;
  int64_t fence = 0;
  int64_t index = 0;  // among the request's frames
  double time_s = 0;
  std::string path;  // in scratch_dir: a native container
  uint64_t voxel_count = 0;
  std::string content_hash;
  int64_t frames_total = 0;  // of the request; 0: as progress says
};
struct TaskFrameReply {
  bool cancel = false;
  bool fenced = false;
  std::string grid;  // id of the container
  std::string path;  // where it is now, read-only
};

// Tiles of one grid that are done, after those of the parts before. The gateway keeps the container
// with them, whose meta tells how far they reach, until the job ends: others go on there.
struct TaskPart {
  std::string task;
  int64_t fence = 0;
  int64_t position = 0;  // among the job's parts; it replaces those that were at and after this
  std::string path;      // in scratch_dir: a native container
};
struct TaskPartReply {
  bool cancel = false;
  bool fenced = false;
};

struct TaskCompletion {
  std::string task;
  int64_t fence = 0;
  std::vector<TaskOutput> outputs;
  StageTimes timings;
  std::string meta_json = "{}";
  std::vector<Warning> warnings;
};
// All that it has done is with the gateway. Only where it was asked to.
struct TaskPark {
  std::string task;
  int64_t fence = 0;
  int64_t tiles_done = 0, tiles_total = 0;  // of a sequence 0, 0: its frames are listed
  StageTimes timings;                       // of this attempt
};
struct TaskFailure {
  std::string task;
  int64_t fence = 0;
  Error error;
};

// The first message of a connection for turns.
struct TurnsHello {
  int protocol = kTaskProtocolVersion;
  int64_t pid = 0;
  std::string device;
};
enum class TurnAction { kTake, kRenew, kGive };
struct TurnRequest {
  TurnAction action = TurnAction::kTake;
  std::string task;
  int64_t fence = 0;
  // Upper estimates of what the task needs from here to its end, with what its process has already;
  // of kTake. Those of a task's first turn count.
  int64_t host_bytes = 0, device_bytes = 0;
};
struct TurnReply {
  bool granted = false;
  bool cancel = false;         // nobody wants the task's result
  bool fenced = false;         // another worker owns the task
  std::optional<Error> error;  // it cannot have one: the task fails with this
};

// The JSON of a frame of the socket, of at most kTaskFrameBytesMax: the paths of a long sequence
// are more than fits into the body of a request. Errors: as parse_json_bounded().
Result<nlohmann::json> parse_task_message(std::string_view text);

nlohmann::json to_json_message(const WorkerHello& hello);
nlohmann::json to_json_message(const WorkerFolders& folders);
nlohmann::json to_json_message(const Task& task);
nlohmann::json to_json_message(const TaskProgress& progress);
nlohmann::json to_json_message(const TaskFrame& frame);
nlohmann::json to_json_message(const TaskFrameReply& reply);
nlohmann::json to_json_message(const TaskPart& part);
nlohmann::json to_json_message(const TaskCompletion& completion);
nlohmann::json to_json_message(const TaskPark& park);
nlohmann::json to_json_message(const TaskFailure& failure);
nlohmann::json to_json_message(const TurnsHello& hello);
nlohmann::json to_json_message(const TurnRequest& request);
nlohmann::json to_json_message(const TurnReply& reply);
Result<TurnsHello> parse_turns_hello(const nlohmann::json& message);
Result<TurnRequest> parse_turn_request(const nlohmann::json& message);
Result<TurnReply> parse_turn_reply(const nlohmann::json& message);
Result<WorkerHello> parse_worker_hello(const nlohmann::json& message);
Result<WorkerFolders> parse_worker_folders(const nlohmann::json& message);
Result<Task> parse_task(const nlohmann::json& message);
Result<TaskProgress> parse_task_progress(const nlohmann::json& message);
Result<TaskFrame> parse_task_frame(const nlohmann::json& message);
Result<TaskFrameReply> parse_task_frame_reply(const nlohmann::json& message);
Result<TaskPart> parse_task_part(const nlohmann::json& message);
Result<TaskCompletion> parse_task_completion(const nlohmann::json& message);
Result<TaskPark> parse_task_park(const nlohmann::json& message);
Result<TaskFailure> parse_task_failure(const nlohmann::json& message);

}  // namespace voxeld
