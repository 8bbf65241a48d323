// Field lists (json_fields.h) of a job on the wire, and of the parts that the job API and the task
// API share.
#pragma once

#include <array>
#include <string>
#include <string_view>

#include "proto/messages/field_rules.h"
#include "proto/messages/job.h"
#include "proto/messages/json_fields.h"
#include "proto/messages/task_bounds.h"

namespace voxeld {

// In the order of the enumerators.
inline constexpr std::array<std::string_view, 4> kJobKindWords = {"voxelize", "render", "export",
                                                                  "inspect"};
inline constexpr std::array<std::string_view, 5> kJobStateWords = {"queued", "running", "done",
                                                                   "failed", "cancelled"};
constexpr const auto& enum_words(JobKind) {
  return kJobKindWords;
}
constexpr const auto& enum_words(JobState) {
  return kJobStateWords;
}

// A member that its own function reads.
struct ReadElsewhere {
  Status read(const nlohmann::json&) { return {}; }
  template <typename Tree>
  Tree tree() const {
    return Tree::object();
  }
};

// An error's code by its name. An unknown name is `internal`.
template <typename Code>
struct CodeName {
  explicit CodeName(Code& member) : code(member) {}
  Code& code;

  Status read(const nlohmann::json& json) {
    std::string name;
    VOXELD_TRY(read_value(json, name));
    code = error_code_from_name(name);
    return {};
  }
  template <typename Tree>
  Tree tree() const {
    return info_of(code).name;
  }
};

// A member of the struct that is the text of a JSON object, and that object in JSON.
struct ObjectText {
  explicit ObjectText(const std::string& member) : text(member) {}
  const std::string& text;
};

void visit_fields(IsA<Error> auto& error, auto& visit) {
  visit.name("error");
  visit(kOptional, "code", CodeName{error.code});
  visit(kOptional, "detail", error.detail);
  visit(kUnlessDefault, "expected", error.expected);
  visit(kUnlessDefault, "got", error.got);
}

void visit_fields(IsA<Warning> auto& warning, auto& visit) {
  visit(kOptional, "code", warning.code, plain_text_up_to(limits::kTaskNameBytesMax));
  visit(kOptional, "detail", warning.detail, text_up_to(limits::kTaskTextBytesMax));
}

void visit_fields(IsA<JobRequest> auto& request, auto& visit) {
  visit.name("job");
  visit(kRequired, "kind", request.kind);
  visit(kOptional, "asset", request.asset);
  visit(kOptional, "grid", request.grid);
  visit(kOptional, "sequence", request.sequence);
  visit(kOptional, "filename", request.filename);
  visit(kOptional, "options", ReadElsewhere{});  // parse_options(), in the scope of the request
  visit(kOptional, "priority", request.priority);
  visit(kOptional, "deadline_ms", request.deadline_ms);
}

void visit_fields(IsA<JobEstimate> auto& estimate, auto& visit) {
  visit(kOptional, "seconds", estimate.seconds);
  visit(kOptional, "seconds_low", estimate.seconds_low);
  visit(kOptional, "seconds_high", estimate.seconds_high);
  visit(kOptional, "device_seconds", estimate.device_seconds);
  visit(kOptional, "result_bytes", estimate.result_bytes);
  visit(kOptional, "host_bytes", estimate.host_bytes);
  visit(kOptional, "learned_from", estimate.learned_from);
  visit(kUnlessDefault, "overrun", estimate.overrun);
}

void visit_fields(const JobResult& result, auto& visit) {
  visit(kOptional, "blob", result.blob);
  visit(kOptional, "bytes", result.bytes);
  visit(kOptional, "media_type", result.media_type);
  visit(kOptional, "filename", result.filename);
  visit(kOptional, "grid", result.grid);
  visit(kOptional, "sequence", result.sequence);
  visit(kOptional, "meta", ObjectText{result.meta_json});
  visit(kOptional, "warnings", result.warnings);
}

// The members of a status that change as the job goes on, and the others: job_text.h writes each
// part alone.
void visit_changing_fields(const JobStatus& status, auto& visit) {
  visit(kOptional, "id", status.id);
  visit(kRequired, "kind", status.kind);
  visit(kRequired, "state", status.state);
  visit(kOptional, "asset", status.asset);
  visit(kOptional, "grid", status.grid);
  visit(kOptional, "sequence", status.sequence);
  visit(kOptional, "version", status.version);
  visit(kOptional, "attempt", status.attempt);
  visit(kOptional, "preempted", status.preempted);
  visit(kOptional, "tiles_done", status.tiles_done);
  visit(kOptional, "tiles_total", status.tiles_total);
  visit(kOptional, "frames_done", status.frames_done);
  visit(kOptional, "frames_total", status.frames_total);
  visit(kOptional, "queue_position", status.queue_position);
  visit(kOptional, "created_ms", status.created_ms);
  visit(kOptional, "started_ms", status.started_ms);
  visit(kOptional, "ended_ms", status.ended_ms);
  visit(kOptional, "priority", status.priority);
  visit(kOptional, "deadline_at_ms", status.deadline_at_ms);
  visit(kOptional, "device_ms", status.device_ms);
  visit(kOptional, "cached", status.cached);
  visit(kOptional, "filename", status.filename);
  visit(kOptional, "stage", status.stage);
  visit(kOptional, "waiting_for", status.waiting_for);
  visit(kOptional, "timings", status.timings);
  visit(kOptional, "error", status.error);
  visit(kOptional, "estimate", status.estimate);
  visit(kUnlessDefault, "expected_start_ms", status.expected_start_ms);
  visit(kUnlessDefault, "expected_end_ms", status.expected_end_ms);
}
void visit_fixed_fields(const JobStatus& status, auto& visit) {
  visit(kOptional, "options", ObjectText{status.options_json});
  visit(kOptional, "result", status.result);
}

}  // namespace voxeld
