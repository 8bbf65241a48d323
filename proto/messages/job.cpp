#include "proto/messages/job.h"

#include <nlohmann/json.hpp>

#include "proto/messages/job_fields.h"
#include "proto/messages/json_fields.h"
#include "proto/text/client_texts.h"

namespace voxeld {
namespace {

using Json = nlohmann::json;

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
  return word_of(kind);
}
std::string_view job_state_name(JobState state) {
  return word_of(state);
}
std::optional<JobKind> job_kind_from_name(std::string_view name) {
  return enum_from_word<JobKind>(name);
}
std::optional<JobState> job_state_from_name(std::string_view name) {
  return enum_from_word<JobState>(name);
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
  VOXELD_TRY(read_fields(body, request, Unlisted::kRefuse));
  VOXELD_TRY(check_texts(request));
  VOXELD_TRY(check_urgency(request));
  VOXELD_TRY(check_input(request));
  const auto options = body.find("options");
  VOXELD_ASSIGN(request.options, parse_options(options != body.end() ? *options : Json::object(),
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
  return fields_json<Json>(estimate);
}

Json problem_json(const Error& error, std::string_view instance) {
  const ErrorCodeInfo& info = info_of(error.code);
  Json out = fields_json<Json>(error);
  out["type"] = "urn:voxeld:error:" + std::string(info.name);
  out["title"] = info.title;
  out["status"] = info.http_status;
  if (!instance.empty()) out["instance"] = instance;
  return out;
}

Status check_texts(const JobRequest& request) {
  VOXELD_TRY(check_length(client_texts::kAsset, request.asset));
  VOXELD_TRY(check_length(client_texts::kGrid, request.grid));
  VOXELD_TRY(check_length(client_texts::kSequence, request.sequence));
  return check_filename(request.filename);
}

}  // namespace voxeld
