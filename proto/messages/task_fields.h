// Field lists (json_fields.h) of the task API, with the bounds of what a worker sends.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "proto/container/sequence_format.h"
#include "proto/limits.h"
#include "proto/messages/field_rules.h"
#include "proto/messages/job_fields.h"
#include "proto/messages/json_bounds.h"
#include "proto/messages/json_fields.h"
#include "proto/messages/task_api.h"
#include "proto/messages/task_bounds.h"
#include "proto/output_format.h"

namespace voxeld {
namespace task_rules {

// The stages that workers measure. Each is a time series of voxeld_stage_seconds, so the set is
// closed.
inline constexpr std::array<std::string_view, 6> kStages = {"parse",  "place",  "voxelize",
                                                            "render", "encode", "inspect"};
inline constexpr auto kIsStage =
    one_of(kStages, "parse, place, voxelize, render, encode or inspect");
inline constexpr std::array<std::string_view, 3> kRoles = {"result", "grid", "sequence"};
inline constexpr auto kIsRole = one_of(kRoles, "result, grid or sequence");
inline constexpr auto kIsName = plain_text_up_to(limits::kTaskNameBytesMax);
inline constexpr auto kIsPath = text_up_to(limits::kTaskPathBytesMax);
inline constexpr auto kIsContentHash = blob_id("sha256- and 64 hex digits");
inline constexpr auto kIsMemory = within(0, limits::kMemoryBytesMax);
// Media types beside those of grids and sequences.
inline constexpr std::array<std::string_view, 4> kMediaTypes = {"application/json", "image/apng",
                                                                "image/gif", "image/png"};

inline Status is_stage_or_none(std::string_view stage) {
  return stage.empty() ? Status() : kIsStage(stage);
}

inline Status is_media_type(std::string_view type) {
  for (const FormatInfo& format : output_formats()) {
    if (type == format.media_type || type == format.sequence_media_type) return {};
  }
  return one_of(kMediaTypes, "that of a format of results")(type);
}

inline Status are_timings(const StageTimes& timings) {
  VOXELD_TRY(count_up_to(limits::kTaskTimingsMax)(timings));
  for (const auto& [stage, ms] : timings) {
    VOXELD_TRY(kIsStage(stage));
    if (!(ms >= 0 && ms <= limits::kStageMsMax)) {
      return within_member(" of " + stage,
                           unfit("milliseconds from 0 to 1e10", std::to_string(ms)));
    }
  }
  return {};
}

inline Status is_short_error(const Error& error) {
  for (const auto& [name, text] : {std::pair{".detail", &error.detail},
                                   {".expected", &error.expected},
                                   {".got", &error.got}}) {
    if (const Status status = text_up_to(limits::kTaskErrorBytesMax)(*text); !status) {
      return within_member(name, status.error());
    }
  }
  return {};
}

// The text of a JSON object within the bounds. The values are built only to be dropped.
constexpr auto object_text(const JsonBounds& bounds) {
  return [=](const std::string& text) -> Status {
    const auto object = parse_json_bounded(text, bounds);
    if (object) return object->is_object() ? Status() : unfit("an object", object->type_name());
    Error error = object.error();
    error.code = ErrorCode::kBadRequest;
    return within_member(": ", std::move(error));
  };
}
inline Status is_device_json(const std::string& text) {
  if (text.empty()) return {};
  return object_text({.bytes_max = limits::kDeviceJsonBytesMax,
                      .depth_max = limits::kMetaDepthMax,
                      .values_max = limits::kDeviceJsonValuesMax})(text);
}
inline constexpr auto kIsMeta = object_text({.bytes_max = limits::kMetaBytesMax,
                                             .depth_max = limits::kMetaDepthMax,
                                             .values_max = limits::kMetaValuesMax,
                                             .members_max = limits::kMetaMembersMax});

}  // namespace task_rules

inline constexpr std::array<std::string_view, 3> kSliceActionWords = {"slice_take", "slice_renew",
                                                                      "slice_give"};
constexpr const auto& enum_words(SliceAction) {
  return kSliceActionWords;
}

void visit_fields(IsA<WorkerHello> auto& hello, auto& visit) {
  using namespace task_rules;
  visit.type("hello");
  visit(kRequired, "protocol", hello.protocol);
  visit(kRequired, "pid", hello.pid);
  visit(kRequired, "device", hello.device, kIsName);
  visit(kOptional, "renderer", hello.renderer, kIsName);
  visit(kOptional, "driver", hello.driver, kIsName);
  visit(kOptional, "device_json", hello.device_json, is_device_json);
  visit(kOptional, "sandbox", hello.sandbox, kIsName);
  visit(kOptional, "device_failure", hello.device_failure, text_up_to(limits::kTaskErrorBytesMax));
}

void visit_fields(IsA<WorkerFolders> auto& folders, auto& visit) {
  visit.type("folders");
  visit(kRequired, "scratch_dir", folders.scratch_dir);
  visit(kRequired, "input_dir", folders.input_dir);
  visit(kRequired, "cache_dir", folders.cache_dir);
  visit(kRequired, "disk_reserve_bytes", folders.disk_reserve_bytes);
}

void visit_fields(IsA<TaskDoneFrame> auto& frame, auto& visit) {
  visit(kRequired, "grid", frame.grid);
  visit(kRequired, "path", frame.path);
  visit(kRequired, "time_s", frame.time_s);
  visit(kRequired, "voxel_count", frame.voxel_count);
  visit(kRequired, "content_hash", frame.content_hash);
}

void visit_fields(IsA<Task> auto& task, auto& visit) {
  visit.type("task");
  visit(kRequired, "id", task.id);
  visit(kRequired, "fence", task.fence);
  visit(kOptional, "attempt", task.attempt);
  visit(kRequired, "kind", task.kind);
  visit(kRequired, "input_path", task.input_path);
  visit(kOptional, "input_hash", task.input_hash);
  visit(kOptional, "input_is_grid", task.input_is_grid);
  visit(kOptional, "input_is_sequence", task.input_is_sequence);
  visit(kOptional, "frame_paths", task.frame_paths);
  visit(kOptional, "bundle_paths", task.bundle_paths);
  visit(kOptional, "filename", task.filename);
  visit(kRequired, "options_json", task.options_json);
  visit(kOptional, "part_paths", task.part_paths);
  visit(kOptional, "done_frames", task.done_frames);
  visit(kOptional, "tenant", task.tenant);
  visit(kOptional, "request_id", task.request_id);
  visit(kOptional, "trace_id", task.trace_id);
  visit(kOptional, "cells_max", task.cells_max);
}

void visit_fields(IsA<TaskProgress> auto& progress, auto& visit) {
  using namespace task_rules;
  visit.type("progress");
  visit(kRequired, "task", progress.task);
  visit(kRequired, "fence", progress.fence);
  visit(kOptional, "stage", progress.stage, is_stage_or_none);
  visit(kOptional, "tiles_done", progress.tiles_done, within(0, limits::kTilesMax));
  visit(kOptional, "tiles_total", progress.tiles_total, within(0, limits::kTilesMax));
  visit(kOptional, "frames_done", progress.frames_done, within(0, limits::kFramesMax));
  visit(kOptional, "frames_total", progress.frames_total, within(0, limits::kFramesMax));
  visit(kOptional, "device_bytes_total", progress.device_memory.bytes_total, kIsMemory);
  visit(kOptional, "device_bytes_free", progress.device_memory.bytes_free, kIsMemory);
  visit(kOptional, "is_preemptible", progress.is_preemptible);
  visit(kOptional, "preparation_ms", progress.preparation_ms,
        within(0, static_cast<int64_t>(limits::kStageMsMax)));
}

void visit_fields(IsA<TaskProgressReply> auto& reply, auto& visit) {
  visit.name("reply");
  visit(kOptional, "cancel", reply.cancel);
  visit(kOptional, "fenced", reply.fenced);
  visit(kOptional, "preempt", reply.preempt);
}

void visit_fields(IsA<TaskFrame> auto& frame, auto& visit) {
  using namespace task_rules;
  visit.type("frame");
  visit(kRequired, "task", frame.task);
  visit(kRequired, "fence", frame.fence);
  visit(kRequired, "index", frame.index, within(0, limits::kFramesMax - 1));
  visit(kRequired, "time_s", frame.time_s, seconds_from_0());
  visit(kRequired, "path", frame.path, kIsPath);
  visit(kRequired, "voxel_count", frame.voxel_count);
  visit(kRequired, "content_hash", frame.content_hash, kIsContentHash);
  visit(kOptional, "frames_total", frame.frames_total, within(0, limits::kFramesMax));
}

void visit_fields(IsA<TaskFrameReply> auto& reply, auto& visit) {
  visit.name("reply");
  visit(kRequired, "cancel", reply.cancel);
  visit(kRequired, "fenced", reply.fenced);
  visit(kOptional, "grid", reply.grid);
  visit(kOptional, "path", reply.path);
}

void visit_fields(IsA<TaskPart> auto& part, auto& visit) {
  visit.type("part");
  visit(kRequired, "task", part.task);
  visit(kRequired, "fence", part.fence);
  visit(kRequired, "position", part.position, within(0, kPartsMax - 1));
  visit(kRequired, "path", part.path, task_rules::kIsPath);
}

void visit_fields(IsA<TaskPartReply> auto& reply, auto& visit) {
  visit.name("reply");
  visit(kOptional, "cancel", reply.cancel);
  visit(kOptional, "fenced", reply.fenced);
  visit(kUnlessDefault, "error", reply.error);
}

void visit_fields(IsA<TaskOutput> auto& output, auto& visit) {
  using namespace task_rules;
  visit(kOptional, "role", output.role, kIsRole);
  visit(kOptional, "path", output.path, kIsPath);
  visit(kOptional, "media_type", output.media_type, is_media_type);
  visit(kOptional, "filename", output.filename, plain_text_up_to(limits::kTaskTextBytesMax));
}

void visit_fields(IsA<TaskCompletion> auto& completion, auto& visit) {
  using namespace task_rules;
  visit.type("complete");
  visit(kRequired, "task", completion.task);
  visit(kRequired, "fence", completion.fence);
  visit(kRequired, "outputs", completion.outputs, count_up_to(limits::kTaskOutputsMax));
  visit(kRequired, "timings", completion.timings, are_timings);
  visit(kOptional, "meta_json", completion.meta_json, kIsMeta);
  visit(kRequired, "warnings", completion.warnings, count_up_to(limits::kTaskWarningsMax));
}

void visit_fields(IsA<TaskPreemption> auto& preempt, auto& visit) {
  visit.type("preempt");
  visit(kRequired, "task", preempt.task);
  visit(kRequired, "fence", preempt.fence);
  visit(kRequired, "tiles_total", preempt.tiles_total, within(0, limits::kTilesMax));
  visit(kRequired, "tiles_done", preempt.tiles_done, within(0, preempt.tiles_total));
  visit(kRequired, "timings", preempt.timings, task_rules::are_timings);
}

void visit_fields(IsA<TaskFailure> auto& failure, auto& visit) {
  visit.type("fail");
  visit(kRequired, "task", failure.task);
  visit(kRequired, "fence", failure.fence);
  visit(kRequired, "error", failure.error, task_rules::is_short_error);
}

void visit_fields(IsA<SlicesHello> auto& hello, auto& visit) {
  visit.type("slices");
  visit(kRequired, "protocol", hello.protocol);
  visit(kRequired, "pid", hello.pid);
  visit(kRequired, "device", hello.device, task_rules::kIsName);
}

void visit_fields(IsA<SliceRequest> auto& request, auto& visit) {
  visit.name("slice");
  visit(kRequired, "task", request.task);
  visit(kRequired, "fence", request.fence);
  visit(kRequired, "type", request.action);
  visit(kUnlessDefault, "host_bytes", request.host_bytes, task_rules::kIsMemory);
  visit(kUnlessDefault, "device_bytes", request.device_bytes, task_rules::kIsMemory);
}

void visit_fields(IsA<SliceReply> auto& reply, auto& visit) {
  visit.name("reply");
  visit(kRequired, "granted", reply.granted);
  visit(kRequired, "cancel", reply.cancel);
  visit(kRequired, "fenced", reply.fenced);
  visit(kOptional, "error", reply.error);
}

}  // namespace voxeld
