#include "proto/messages/job.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "proto/client_texts.h"
#include "proto/messages/job_json.h"
#include "proto/messages/json_fields.h"

namespace voxeld {
namespace {

using Json = nlohmann::json;

constexpr std::array<std::string_view, 4> kKinds = {"voxelize", "render", "export", "inspect"};
constexpr std::array<std::string_view, 5> kStates = {"queued", "running", "done", "failed",
                                                     "cancelled"};

Result<JobResult> parse_result(const Json& body) {
  JobResult result;
  JsonFields fields(body, "result");
  fields.read("blob", result.blob);
  fields.read("bytes", result.bytes);
  fields.read("media_type", result.media_type);
  fields.read("filename", result.filename);
  fields.read("grid", result.grid);
  fields.read("sequence", result.sequence);
  if (const Json* meta = fields.member("meta")) result.meta_json = meta->dump();
  const Json* warnings = fields.member("warnings");
  VOXELD_TRY(fields.finish());
  if (warnings != nullptr) {
    VOXELD_ASSIGN(result.warnings, parse_warnings(*warnings));
  }
  return result;
}

Result<JobEstimate> parse_estimate(const Json& body) {
  JobEstimate estimate;
  JsonFields fields(body, "estimate");
  fields.read("seconds", estimate.seconds);
  fields.read("seconds_low", estimate.seconds_low);
  fields.read("seconds_high", estimate.seconds_high);
  fields.read("device_seconds", estimate.device_seconds);
  fields.read("result_bytes", estimate.result_bytes);
  fields.read("host_bytes", estimate.host_bytes);
  fields.read("learned_from", estimate.learned_from);
  VOXELD_TRY(fields.finish());
  return estimate;
}

constexpr std::array<std::string_view, 8> kMembers = {
    "kind", "asset", "grid", "sequence", "filename", "options", "priority", "deadline_ms"};

Status check_members(const Json& body) {
  for (const auto& [name, value] : body.items()) {
    if (std::ranges::find(kMembers, name) == kMembers.end()) {
      return Error{ErrorCode::kBadRequest, "job: no such member",
                   "kind, asset, grid, sequence, filename, options, priority, deadline_ms",
                   "\"" + name.substr(0, 40) + "\""};
    }
  }
  return {};
}

// The inputs that the kind takes, as an error names them.
std::string_view inputs_of(JobKind kind) {
  switch (kind) {
    case JobKind::kRender:
      return "one of asset, grid and sequence";
    case JobKind::kExport:
      return "either grid or sequence";
    case JobKind::kVoxelize:
    case JobKind::kInspect:
      break;
  }
  return "asset";
}

Status check_input(const JobRequest& request) {
  const bool takes_asset = request.kind != JobKind::kExport;
  const bool takes_grid = request.kind == JobKind::kRender || request.kind == JobKind::kExport;
  std::string got;
  bool is_taken = true;
  int count = 0;
  const auto see = [&](const std::string& id, std::string_view name, bool takes) {
    if (id.empty()) return;
    got += (got.empty() ? "" : " and ") + std::string(name);
    is_taken = is_taken && takes;
    ++count;
  };
  see(request.asset, "asset", takes_asset);
  see(request.grid, "grid", takes_grid);
  see(request.sequence, "sequence", takes_grid);
  if (is_taken && count == 1) return {};
  return Error{ErrorCode::kBadRequest,
               "job: input of kind " + std::string(job_kind_name(request.kind)),
               std::string(inputs_of(request.kind)), got.empty() ? "none" : got};
}

}  // namespace

std::string_view job_kind_name(JobKind kind) {
  return kKinds[static_cast<size_t>(kind)];
}
std::string_view job_state_name(JobState state) {
  return kStates[static_cast<size_t>(state)];
}

std::optional<JobKind> job_kind_from_name(std::string_view name) {
  const auto it = std::ranges::find(kKinds, name);
  if (it == kKinds.end()) return std::nullopt;
  return static_cast<JobKind>(it - kKinds.begin());
}

std::optional<JobState> job_state_from_name(std::string_view name) {
  const auto it = std::ranges::find(kStates, name);
  if (it == kStates.end()) return std::nullopt;
  return static_cast<JobState>(it - kStates.begin());
}

OptionScope option_scope(const JobRequest& request) {
  switch (request.kind) {
    case JobKind::kRender:
      return request.grid.empty() && request.sequence.empty() ? OptionScope::kRenderMesh
                                                              : OptionScope::kRenderGrid;
    case JobKind::kExport:
      return OptionScope::kExport;
    case JobKind::kVoxelize:
    case JobKind::kInspect:
      break;
  }
  return OptionScope::kVoxelize;
}

Result<JobRequest> parse_job_request(const Json& body) {
  JobRequest request;
  JsonFields fields(body, "job");
  VOXELD_TRY(fields.finish());
  VOXELD_TRY(check_members(body));
  std::string kind;
  fields.read("kind", kind);
  fields.read("asset", request.asset);
  fields.read("grid", request.grid);
  fields.read("sequence", request.sequence);
  fields.read("filename", request.filename);
  if (body.contains("priority")) fields.read("priority", request.priority.emplace(0));
  if (body.contains("deadline_ms")) fields.read("deadline_ms", request.deadline_ms.emplace(0));
  VOXELD_TRY(fields.finish());
  VOXELD_TRY(check_texts(request));
  VOXELD_TRY(check_urgency(request));
  const auto known = job_kind_from_name(kind);
  if (!known) {
    return Error{ErrorCode::kBadRequest, "job.kind", "voxelize | render | export | inspect",
                 "\"" + kind.substr(0, 40) + "\""};
  }
  request.kind = *known;
  VOXELD_TRY(check_input(request));
  const Json* options = fields.member("options");
  VOXELD_ASSIGN(request.options, parse_options(options != nullptr ? *options : Json::object(),
                                               option_scope(request)));
  VOXELD_TRY(check_frame_options(request));
  if (request.filename.empty()) request.filename = request.options.filename;
  return request;
}

Status check_urgency(const JobRequest& request) {
  const int priority = request.priority.value_or(0);
  if (priority < -limits::kPriorityMax || priority > limits::kPriorityMax) {
    return Error{
        ErrorCode::kInvalidOption, "priority",
        "-" + std::to_string(limits::kPriorityMax) + " to " + std::to_string(limits::kPriorityMax),
        std::to_string(priority)};
  }
  const int64_t deadline_ms = request.deadline_ms.value_or(1);
  if (deadline_ms < 1 || deadline_ms > limits::kDeadlineMsMax) {
    return Error{ErrorCode::kInvalidOption, "deadline_ms",
                 "1 to " + std::to_string(limits::kDeadlineMsMax) + " milliseconds from now",
                 std::to_string(deadline_ms)};
  }
  return {};
}

Status check_frame_options(const JobRequest& request) {
  const auto invalid = [](const char* option, const char* expected, const char* got) {
    return Error{ErrorCode::kInvalidOption, option, expected, got};
  };
  const RenderOptions& render = request.options.render;
  if (!request.sequence.empty() && render.turntable > 0) {
    return invalid("turntable", "a grid as input", "a sequence");
  }
  if (request.grid.empty()) return {};
  if (request.options.animation.frames) return invalid("frames", "a sequence as input", "a grid");
  if (render.frame > 0) return invalid("frame", "a sequence as input", "a grid");
  if (render.image != ImageKind::kPng && render.turntable == 0) {
    return invalid("image", "png, or turntable with a grid as input", "a grid without turntable");
  }
  return {};
}

Json job_estimate_json(const JobEstimate& estimate) {
  return {{"seconds", estimate.seconds},           {"seconds_low", estimate.seconds_low},
          {"seconds_high", estimate.seconds_high}, {"device_seconds", estimate.device_seconds},
          {"result_bytes", estimate.result_bytes}, {"host_bytes", estimate.host_bytes},
          {"learned_from", estimate.learned_from}};
}

Result<JobStatus> parse_job_status(const Json& body) {
  JobStatus status;
  JsonFields fields(body, "job");
  std::string kind, state;
  fields.read("id", status.id);
  fields.read("kind", kind);
  fields.read("state", state);
  fields.read("asset", status.asset);
  fields.read("grid", status.grid);
  fields.read("sequence", status.sequence);
  fields.read("filename", status.filename);
  fields.read("version", status.version);
  fields.read("attempt", status.attempt);
  fields.read("preempted", status.preempted);
  fields.read("tiles_done", status.tiles_done);
  fields.read("tiles_total", status.tiles_total);
  fields.read("frames_done", status.frames_done);
  fields.read("frames_total", status.frames_total);
  fields.read("stage", status.stage);
  fields.read("queue_position", status.queue_position);
  fields.read("created_ms", status.created_ms);
  fields.read("started_ms", status.started_ms);
  fields.read("ended_ms", status.ended_ms);
  fields.read("priority", status.priority);
  fields.read("deadline_at_ms", status.deadline_at_ms);
  fields.read("device_ms", status.device_ms);
  fields.read("waiting_for", status.waiting_for);
  fields.read("cached", status.cached);
  fields.read("expected_start_ms", status.expected_start_ms);
  fields.read("expected_end_ms", status.expected_end_ms);
  const Json* estimate = fields.member("estimate");
  const auto known_kind = job_kind_from_name(kind);
  const auto known_state = job_state_from_name(state);
  if (!known_kind) fields.fail("kind", "a kind of job", kind);
  if (!known_state) fields.fail("state", "a state of a job", state);
  const Json* options = fields.member("options");
  const Json* timings = fields.member("timings");
  const Json* result = fields.member("result");
  const Json* error = fields.member("error");
  VOXELD_TRY(fields.finish());
  status.kind = *known_kind;
  status.state = *known_state;
  if (options != nullptr) status.options_json = options->dump();
  if (timings != nullptr && timings->is_object()) {
    for (const auto& [stage, ms] : timings->items()) {
      if (ms.is_number()) status.timings.emplace_back(stage, ms.get<double>());
    }
  }
  if (result != nullptr) {
    VOXELD_ASSIGN(status.result, parse_result(*result));
  }
  if (error != nullptr) {
    status.error = parse_error_json(*error);
  }
  if (estimate != nullptr) {
    VOXELD_ASSIGN(status.estimate, parse_estimate(*estimate));
  }
  return status;
}

Json error_json(const Error& error) {
  Json out = {{"code", info_of(error.code).name}, {"detail", error.detail}};
  if (!error.expected.empty()) out["expected"] = error.expected;
  if (!error.got.empty()) out["got"] = error.got;
  return out;
}

Error parse_error_json(const Json& body) {
  Error error;
  std::string code;
  JsonFields fields(body, "error");
  fields.read("code", code);
  fields.read("detail", error.detail);
  fields.read("expected", error.expected);
  fields.read("got", error.got);
  if (const Status status = fields.finish(); !status) {
    return {ErrorCode::kInternal, "not a problem document: " + status.error().message(), "", ""};
  }
  error.code = error_code_from_name(code);
  return error;
}

Json warnings_json(const std::vector<Warning>& warnings) {
  Json out = Json::array();
  for (const Warning& warning : warnings) {
    out.push_back({{"code", warning.code}, {"detail", warning.detail}});
  }
  return out;
}

Result<std::vector<Warning>> parse_warnings(const Json& body) {
  std::vector<Warning> warnings;
  if (!body.is_array()) {
    return Error{ErrorCode::kBadRequest, "warnings", "a list", body.type_name()};
  }
  for (const Json& entry : body) {
    Warning warning;
    JsonFields fields(entry, "warning");
    fields.read("code", warning.code);
    fields.read("detail", warning.detail);
    VOXELD_TRY(fields.finish());
    warnings.push_back(std::move(warning));
  }
  return warnings;
}

Json timings_json(const StageTimes& timings) {
  Json out = Json::array();
  for (const auto& [stage, ms] : timings) out.push_back(Json::array({stage, ms}));
  return out;
}

Result<StageTimes> parse_timings(const Json& body) {
  StageTimes timings;
  if (!body.is_array()) {
    return Error{ErrorCode::kBadRequest, "timings", "a list", body.type_name()};
  }
  for (const Json& entry : body) {
    if (!entry.is_array() || entry.size() != 2 || !entry[0].is_string() || !entry[1].is_number()) {
      return Error{ErrorCode::kBadRequest, "timings", "pairs of stage and milliseconds", ""};
    }
    timings.emplace_back(entry[0].get<std::string>(), entry[1].get<double>());
  }
  return timings;
}

Json problem_json(const Error& error, std::string_view instance) {
  const ErrorCodeInfo& info = info_of(error.code);
  Json out = error_json(error);
  out["type"] = "urn:voxeld:error:" + std::string(info.name);
  out["title"] = info.title;
  out["status"] = info.http_status;
  if (!instance.empty()) out["instance"] = instance;
  return out;
}

Error parse_problem(const Json& body) {
  return parse_error_json(body);
}

Status check_texts(const JobRequest& request) {
  VOXELD_TRY(check_length(client_texts::kAsset, request.asset));
  VOXELD_TRY(check_length(client_texts::kGrid, request.grid));
  VOXELD_TRY(check_length(client_texts::kSequence, request.sequence));
  return check_filename(request.filename);
}

}  // namespace voxeld
