// A job on the wire: the request that POST /v1/jobs takes and the status that GET /v1/jobs/{id}
// gives. Plain structs; JSON is only in job.cpp.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "proto/limits.h"
#include "proto/messages/job.h"
#include "proto/options/options.h"
#include "proto/result.h"

namespace voxeld {

namespace limits {
inline constexpr int kPriorityMax = 100;     // least: -100; beyond: invalid-option
inline constexpr int kOneShotPriority = 10;  // of jobs that a client waits for
inline constexpr int64_t kDeadlineMsMax = int64_t{366} * 24 * 3600 * 1000;  // invalid-option
}  // namespace limits

enum class JobKind {
  kVoxelize,  // asset -> grid or sequence, also in the format asked for
  kRender,    // asset, grid or sequence -> PNG or animated image
  kExport,    // grid or sequence -> the same in another format
  kInspect,   // asset -> description (triangles, bounds, materials found and missing)
};

// Transitions: queued -> running -> done | failed | cancelled; queued -> cancelled;
// running -> queued when its worker died and attempts are left.
enum class JobState { kQueued, kRunning, kDone, kFailed, kCancelled };

// POST /v1/jobs: {"kind":"voxelize","asset":"sha256-…","options":{"size":256,"format":"npy"}}
// kRender takes "asset", "grid" or "sequence"; kExport takes "grid" or "sequence"; kInspect takes
// "asset".
struct JobRequest {
  JobKind kind = JobKind::kVoxelize;
  std::string asset;     // id of an asset, or empty
  std::string grid;      // id of a grid, or empty
  std::string sequence;  // id of a sequence, or empty
  std::string filename;  // of the asset, as uploaded or overridden; decides its format
  RequestOptions options;
  // Urgency among the tenant's own jobs. Neither field is part of the result's name.
  std::optional<int> priority;  // -kPriorityMax to kPriorityMax, the highest first; default: 0, or
                                // kOneShotPriority where a client waits
  std::optional<int64_t> deadline_ms;  // from acceptance on
};

struct Warning {
  std::string code;    // "missing-texture", "ignored-extension", …: stable
  std::string detail;  // names the file or item
};

// Milliseconds of each stage that ran, for Server-Timing. Names: queue upload parse voxelize render
// encode.
using StageTimes = std::vector<std::pair<std::string, double>>;

// The result of finished work.
struct JobResult {
  std::string blob;  // id of the result's bytes
  int64_t bytes = 0;
  std::string media_type;
  std::string filename;   // suggested, e.g. "bunny.npy"
  std::string grid;       // id of the grid's container, for voxelize and render from an asset
  std::string sequence;   // id of the sequence, where the request has several frames
  std::string meta_json;  // object: dims, origin, voxel_size, voxel_count, pipeline, device,
                          // driver, content_hash, source_hash, …
  std::vector<Warning> warnings;
};

// An estimate from earlier jobs of this kind, scaled to the size of this one. Four of five jobs
// take between seconds_low and seconds_high.
struct JobEstimate {
  double seconds = 0, seconds_low = 0, seconds_high = 0;  // of a worker, from claim to end
  double device_seconds = 0;                              // the part of `seconds` on the device
  int64_t result_bytes = 0, host_bytes = 0;               // host: the worker's peak
  int64_t learned_from = 0;                               // number of jobs; 0: a guess
  // A running job's device time so far over the expected one, once that is more than four of five
  // jobs need; 0 until then.
  double overrun = 0;
};

struct JobStatus {
  std::string id;  // "j-" + 32 hex digits
  JobKind kind = JobKind::kVoxelize;
  JobState state = JobState::kQueued;
  std::string asset, grid, sequence, filename;
  std::string options_json;                   // canonical
  int64_t version = 0;                        // grows with every change: ETag, long poll, event id
  int attempt = 0;                            // 1 while the first worker runs it
  int preempted = 0;                          // preemptions: how often it gave its worker to other
                                              // tenants' jobs
  int64_t tiles_done = 0, tiles_total = 0;    // of a sequence: of the current frame
  int64_t frames_done = 0, frames_total = 0;  // 0, 0: not a sequence
  std::string stage;                          // "parse", "voxelize", …, while running
  int64_t queue_position = 0;                 // 0 once it runs or has ended
  int64_t created_ms = 0, started_ms = 0, ended_ms = 0;  // Unix time
  int priority = 0;
  int64_t deadline_at_ms = 0;  // Unix time; 0: none
  double device_ms = 0;        // time on the device, over all attempts
  std::string waiting_for;     // "a worker", "a turn on egl:0: 2 tenants before", "memory: …"
  StageTimes timings;
  std::optional<JobResult> result;  // kDone
  std::optional<Error> error;       // kFailed, kCancelled
  // Set until the job ends: its estimated cost, and when it is expected to start and to end (Unix
  // time; 0: not known) with the queue as it is now.
  std::optional<JobEstimate> estimate;
  int64_t expected_start_ms = 0, expected_end_ms = 0;
  bool cached = false;  // took an earlier job's result

  bool ended() const {
    return state == JobState::kDone || state == JobState::kFailed || state == JobState::kCancelled;
  }
};

std::string_view job_kind_name(JobKind kind);
std::string_view job_state_name(JobState state);
std::optional<JobKind> job_kind_from_name(std::string_view name);
std::optional<JobState> job_state_from_name(std::string_view name);
OptionScope option_scope(const JobRequest& request);

// Validates the whole request: unknown members, kinds, more or less than one input, options.
Result<JobRequest> parse_job_request(const nlohmann::json& body);
// Checks priority and deadline. Errors: invalid-option.
Status check_urgency(const JobRequest& request);
// Refuses frames and views that the input cannot give: frames of a grid, a turntable of a sequence.
// Part of parse_job_request(). Errors: invalid-option.
Status check_frame_options(const JobRequest& request);
nlohmann::json job_estimate_json(const JobEstimate& estimate);

// application/problem+json, RFC 9457: type, title, status, code, detail, expected, got, instance.
nlohmann::json problem_json(const Error& error, std::string_view instance);

// Parses JSON with a cap on depth and size, and without duplicate keys. nlohmann's copy and dump
// recurse, so deep input would overflow the stack. Errors: bad-request, payload-too-large.
Result<nlohmann::json> parse_json_bounded(std::string_view text,
                                          int64_t bytes_max = limits::kJsonBodyBytesMax);

// Checks the lengths of the request's ids and of its filename (client_texts.h).
Status check_texts(const JobRequest& request);

}  // namespace voxeld
