#include "proto/messages/task_api.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "proto/limits.h"
#include "proto/messages/job_json.h"
#include "proto/messages/json_fields.h"
#include "proto/messages/task_bounds.h"

namespace voxeld {
namespace {

using Json = nlohmann::json;

constexpr std::array<std::string_view, 3> kSliceActions = {"slice_take", "slice_renew",
                                                           "slice_give"};

Status check_type(const Json& message, std::string_view expected) {
  std::string type;
  JsonFields fields(message, "message");
  fields.read("type", type);
  VOXELD_TRY(fields.finish());
  if (type == expected) return {};
  return Error{ErrorCode::kBadRequest, "message.type", std::string(expected), type};
}

Status read_paths(const Json* list, std::string_view what, std::vector<std::string>& paths) {
  if (list == nullptr) return {};
  const bool are_texts =
      list->is_array() && std::ranges::all_of(*list, [](const Json& v) { return v.is_string(); });
  if (!are_texts) {
    return Error{ErrorCode::kBadRequest, std::string(what), "a list of texts", list->type_name()};
  }
  paths = list->get<std::vector<std::string>>();
  return {};
}

Json done_frames_json(const std::vector<TaskDoneFrame>& frames) {
  Json list = Json::array();
  for (const TaskDoneFrame& frame : frames) {
    list.push_back({{"grid", frame.grid},
                    {"path", frame.path},
                    {"time_s", frame.time_s},
                    {"voxel_count", frame.voxel_count},
                    {"content_hash", frame.content_hash}});
  }
  return list;
}

Status read_done_frames(const Json* list, std::vector<TaskDoneFrame>& frames) {
  if (list == nullptr) return {};
  if (!list->is_array()) {
    return Error{ErrorCode::kBadRequest, "task.done_frames", "an array", list->type_name()};
  }
  for (const Json& member : *list) {
    TaskDoneFrame& frame = frames.emplace_back();
    int64_t voxel_count = 0;
    JsonFields fields(member, "task.done_frames");
    fields.require({"grid", "path", "time_s", "voxel_count", "content_hash"});
    fields.read("grid", frame.grid);
    fields.read("path", frame.path);
    fields.read("time_s", frame.time_s);
    fields.read("voxel_count", voxel_count);
    fields.read("content_hash", frame.content_hash);
    if (voxel_count < 0) fields.fail("voxel_count", "0 or more", std::to_string(voxel_count));
    VOXELD_TRY(fields.finish());
    frame.voxel_count = static_cast<uint64_t>(voxel_count);
  }
  return {};
}

}  // namespace

Result<Json> parse_task_message(std::string_view text) {
  return parse_json_bounded(text, kTaskFrameBytesMax);
}

Json to_json_message(const WorkerHello& hello) {
  return {{"type", "hello"},
          {"protocol", hello.protocol},
          {"pid", hello.pid},
          {"device", hello.device},
          {"renderer", hello.renderer},
          {"driver", hello.driver},
          {"device_json", hello.device_json},
          {"sandbox", hello.sandbox}};
}

Result<WorkerHello> parse_worker_hello(const Json& message) {
  VOXELD_TRY(check_type(message, "hello"));
  WorkerHello hello;
  JsonFields fields(message, "hello");
  fields.require({"protocol", "pid", "device"});
  fields.read("protocol", hello.protocol);
  fields.read("pid", hello.pid);
  fields.read("device", hello.device);
  fields.read("renderer", hello.renderer);
  fields.read("driver", hello.driver);
  fields.read("device_json", hello.device_json);
  fields.read("sandbox", hello.sandbox);
  VOXELD_TRY(fields.finish());
  VOXELD_TRY(check_bounds(hello));
  return hello;
}

Json to_json_message(const WorkerFolders& folders) {
  return {{"type", "folders"},
          {"scratch_dir", folders.scratch_dir},
          {"input_dir", folders.input_dir},
          {"cache_dir", folders.cache_dir}};
}

Result<WorkerFolders> parse_worker_folders(const Json& message) {
  VOXELD_TRY(check_type(message, "folders"));
  WorkerFolders folders;
  JsonFields fields(message, "folders");
  fields.require({"scratch_dir", "input_dir", "cache_dir"});
  fields.read("scratch_dir", folders.scratch_dir);
  fields.read("input_dir", folders.input_dir);
  fields.read("cache_dir", folders.cache_dir);
  VOXELD_TRY(fields.finish());
  return folders;
}

Json to_json_message(const Task& task) {
  return {{"type", "task"},
          {"id", task.id},
          {"fence", task.fence},
          {"attempt", task.attempt},
          {"kind", job_kind_name(task.kind)},
          {"input_path", task.input_path},
          {"input_hash", task.input_hash},
          {"input_is_grid", task.input_is_grid},
          {"input_is_sequence", task.input_is_sequence},
          {"frame_paths", task.frame_paths},
          {"bundle_paths", task.bundle_paths},
          {"part_paths", task.part_paths},
          {"done_frames", done_frames_json(task.done_frames)},
          {"filename", task.filename},
          {"options_json", task.options_json},
          {"tenant", task.tenant},
          {"request_id", task.request_id},
          {"trace_id", task.trace_id},
          {"cells_max", task.cells_max}};
}

Result<Task> parse_task(const Json& message) {
  VOXELD_TRY(check_type(message, "task"));
  Task task;
  std::string kind;
  JsonFields fields(message, "task");
  fields.require({"id", "fence", "kind", "input_path", "options_json"});
  fields.read("id", task.id);
  fields.read("fence", task.fence);
  fields.read("attempt", task.attempt);
  fields.read("kind", kind);
  fields.read("input_path", task.input_path);
  fields.read("input_hash", task.input_hash);
  fields.read("input_is_grid", task.input_is_grid);
  fields.read("input_is_sequence", task.input_is_sequence);
  const Json* frame_paths = fields.member("frame_paths");
  const Json* bundle_paths = fields.member("bundle_paths");
  const Json* part_paths = fields.member("part_paths");
  const Json* done_frames = fields.member("done_frames");
  fields.read("filename", task.filename);
  fields.read("options_json", task.options_json);
  fields.read("tenant", task.tenant);
  fields.read("request_id", task.request_id);
  fields.read("trace_id", task.trace_id);
  fields.read("cells_max", task.cells_max);
  const auto known = job_kind_from_name(kind);
  if (!known) fields.fail("kind", "a kind of job", kind);
  VOXELD_TRY(fields.finish());
  VOXELD_TRY(read_paths(frame_paths, "task.frame_paths", task.frame_paths));
  VOXELD_TRY(read_paths(bundle_paths, "task.bundle_paths", task.bundle_paths));
  VOXELD_TRY(read_paths(part_paths, "task.part_paths", task.part_paths));
  VOXELD_TRY(read_done_frames(done_frames, task.done_frames));
  task.kind = *known;
  return task;
}

Json to_json_message(const TaskProgress& progress) {
  return {{"type", "progress"},
          {"task", progress.task},
          {"fence", progress.fence},
          {"stage", progress.stage},
          {"tiles_done", progress.tiles_done},
          {"tiles_total", progress.tiles_total},
          {"frames_done", progress.frames_done},
          {"frames_total", progress.frames_total},
          {"device_bytes_total", progress.device_memory.bytes_total},
          {"device_bytes_free", progress.device_memory.bytes_free},
          {"is_preemptible", progress.is_preemptible},
          {"preparation_ms", progress.preparation_ms}};
}

Result<TaskProgress> parse_task_progress(const Json& message) {
  VOXELD_TRY(check_type(message, "progress"));
  TaskProgress progress;
  JsonFields fields(message, "progress");
  fields.require({"task", "fence"});
  fields.read("task", progress.task);
  fields.read("fence", progress.fence);
  fields.read("stage", progress.stage);
  fields.read("tiles_done", progress.tiles_done);
  fields.read("tiles_total", progress.tiles_total);
  fields.read("frames_done", progress.frames_done);
  fields.read("frames_total", progress.frames_total);
  fields.read("device_bytes_total", progress.device_memory.bytes_total);
  fields.read("device_bytes_free", progress.device_memory.bytes_free);
  fields.read("is_preemptible", progress.is_preemptible);
  fields.read("preparation_ms", progress.preparation_ms);
  VOXELD_TRY(fields.finish());
  VOXELD_TRY(check_bounds(progress));
  return progress;
}

Json to_json_message(const TaskFrame& frame) {
  return {{"type", "frame"},
          {"task", frame.task},
          {"fence", frame.fence},
          {"index", frame.index},
          {"time_s", frame.time_s},
          {"path", frame.path},
          {"voxel_count", frame.voxel_count},
          {"content_hash", frame.content_hash},
          {"frames_total", frame.frames_total}};
}

Result<TaskFrame> parse_task_frame(const Json& message) {
  VOXELD_TRY(check_type(message, "frame"));
  TaskFrame frame;
  int64_t voxel_count = 0;
  JsonFields fields(message, "frame");
  fields.require({"task", "fence", "index", "time_s", "path", "voxel_count", "content_hash"});
  fields.read("task", frame.task);
  fields.read("fence", frame.fence);
  fields.read("index", frame.index);
  fields.read("time_s", frame.time_s);
  fields.read("path", frame.path);
  fields.read("voxel_count", voxel_count);
  fields.read("content_hash", frame.content_hash);
  fields.read("frames_total", frame.frames_total);
  if (frame.index < 0 || frame.index >= limits::kFramesMax) {
    fields.fail("index", "0 to " + std::to_string(limits::kFramesMax - 1),
                std::to_string(frame.index));
  }
  if (voxel_count < 0) fields.fail("voxel_count", "0 or more", std::to_string(voxel_count));
  if (frame.frames_total < 0 || frame.frames_total > limits::kFramesMax) {
    fields.fail("frames_total", "0 to " + std::to_string(limits::kFramesMax),
                std::to_string(frame.frames_total));
  }
  VOXELD_TRY(fields.finish());
  frame.voxel_count = static_cast<uint64_t>(voxel_count);
  VOXELD_TRY(check_bounds(frame));
  return frame;
}

Json to_json_message(const TaskFrameReply& reply) {
  return {{"cancel", reply.cancel},
          {"fenced", reply.fenced},
          {"grid", reply.grid},
          {"path", reply.path}};
}

Result<TaskFrameReply> parse_task_frame_reply(const Json& message) {
  TaskFrameReply reply;
  JsonFields fields(message, "reply");
  fields.require({"cancel", "fenced"});
  fields.read("cancel", reply.cancel);
  fields.read("fenced", reply.fenced);
  fields.read("grid", reply.grid);
  fields.read("path", reply.path);
  VOXELD_TRY(fields.finish());
  return reply;
}

Json to_json_message(const TaskPart& part) {
  return {{"type", "part"},
          {"task", part.task},
          {"fence", part.fence},
          {"position", part.position},
          {"path", part.path}};
}

Result<TaskPart> parse_task_part(const Json& message) {
  VOXELD_TRY(check_type(message, "part"));
  TaskPart part;
  JsonFields fields(message, "part");
  fields.require({"task", "fence", "position", "path"});
  fields.read("task", part.task);
  fields.read("fence", part.fence);
  fields.read("position", part.position);
  fields.read("path", part.path);
  if (part.position < 0 || part.position >= kPartsMax) {
    fields.fail("position", "0 to " + std::to_string(kPartsMax - 1), std::to_string(part.position));
  }
  VOXELD_TRY(fields.finish());
  VOXELD_TRY(check_bounds(part));
  return part;
}

Json to_json_message(const TaskCompletion& completion) {
  Json outputs = Json::array();
  for (const TaskOutput& output : completion.outputs) {
    outputs.push_back({{"role", output.role},
                       {"path", output.path},
                       {"media_type", output.media_type},
                       {"filename", output.filename}});
  }
  return {{"type", "complete"},
          {"task", completion.task},
          {"fence", completion.fence},
          {"outputs", std::move(outputs)},
          {"timings", timings_json(completion.timings)},
          {"meta_json", completion.meta_json},
          {"warnings", warnings_json(completion.warnings)}};
}

Result<TaskCompletion> parse_task_completion(const Json& message) {
  VOXELD_TRY(check_type(message, "complete"));
  TaskCompletion completion;
  JsonFields fields(message, "complete");
  fields.require({"task", "fence", "outputs", "timings", "warnings"});
  fields.read("task", completion.task);
  fields.read("fence", completion.fence);
  fields.read("meta_json", completion.meta_json);
  const Json* outputs = fields.member("outputs");
  const Json* timings = fields.member("timings");
  const Json* warnings = fields.member("warnings");
  VOXELD_TRY(fields.finish());
  if (!outputs->is_array()) {
    return Error{ErrorCode::kBadRequest, "complete.outputs", "a list", outputs->type_name()};
  }
  for (const Json& entry : *outputs) {
    TaskOutput output;
    JsonFields output_fields(entry, "complete.outputs");
    output_fields.read("role", output.role);
    output_fields.read("path", output.path);
    output_fields.read("media_type", output.media_type);
    output_fields.read("filename", output.filename);
    VOXELD_TRY(output_fields.finish());
    completion.outputs.push_back(std::move(output));
  }
  VOXELD_ASSIGN(completion.timings, parse_timings(*timings));
  VOXELD_ASSIGN(completion.warnings, parse_warnings(*warnings));
  VOXELD_TRY(check_bounds(completion));
  return completion;
}

Json to_json_message(const TaskPreemption& preempt) {
  return {{"type", "preempt"},
          {"task", preempt.task},
          {"fence", preempt.fence},
          {"tiles_done", preempt.tiles_done},
          {"tiles_total", preempt.tiles_total},
          {"timings", timings_json(preempt.timings)}};
}

Result<TaskPreemption> parse_task_preempt(const Json& message) {
  VOXELD_TRY(check_type(message, "preempt"));
  TaskPreemption preempt;
  JsonFields fields(message, "preempt");
  fields.require({"task", "fence", "tiles_done", "tiles_total", "timings"});
  fields.read("task", preempt.task);
  fields.read("fence", preempt.fence);
  fields.read("tiles_done", preempt.tiles_done);
  fields.read("tiles_total", preempt.tiles_total);
  const Json* timings = fields.member("timings");
  if (preempt.tiles_done < 0 || preempt.tiles_done > preempt.tiles_total) {
    fields.fail("tiles_done", "0 to " + std::to_string(preempt.tiles_total),
                std::to_string(preempt.tiles_done));
  }
  VOXELD_TRY(fields.finish());
  VOXELD_ASSIGN(preempt.timings, parse_timings(*timings));
  VOXELD_TRY(check_bounds(preempt));
  return preempt;
}

Json to_json_message(const TaskFailure& failure) {
  return {{"type", "fail"},
          {"task", failure.task},
          {"fence", failure.fence},
          {"error", error_json(failure.error)}};
}

Result<TaskFailure> parse_task_failure(const Json& message) {
  VOXELD_TRY(check_type(message, "fail"));
  TaskFailure failure;
  JsonFields fields(message, "fail");
  fields.require({"task", "fence", "error"});
  fields.read("task", failure.task);
  fields.read("fence", failure.fence);
  const Json* error = fields.member("error");
  VOXELD_TRY(fields.finish());
  failure.error = parse_error_json(*error);
  VOXELD_TRY(check_bounds(failure));
  return failure;
}

Json to_json_message(const SlicesHello& hello) {
  return {{"type", "slices"},
          {"protocol", hello.protocol},
          {"pid", hello.pid},
          {"device", hello.device}};
}

Result<SlicesHello> parse_slices_hello(const Json& message) {
  VOXELD_TRY(check_type(message, "slices"));
  SlicesHello hello;
  JsonFields fields(message, "slices");
  fields.require({"protocol", "pid", "device"});
  fields.read("protocol", hello.protocol);
  fields.read("pid", hello.pid);
  fields.read("device", hello.device);
  VOXELD_TRY(fields.finish());
  VOXELD_TRY(check_bounds(hello));
  return hello;
}

Json to_json_message(const SliceRequest& request) {
  Json message = {{"type", kSliceActions[static_cast<size_t>(request.action)]},
                  {"task", request.task},
                  {"fence", request.fence}};
  if (request.action == SliceAction::kTake) {
    message["host_bytes"] = request.host_bytes;
    message["device_bytes"] = request.device_bytes;
  }
  return message;
}

Result<SliceRequest> parse_slice_request(const Json& message) {
  SliceRequest request;
  std::string type;
  JsonFields fields(message, "slice");
  fields.require({"type", "task", "fence"});
  fields.read("type", type);
  fields.read("task", request.task);
  fields.read("fence", request.fence);
  fields.read("host_bytes", request.host_bytes);
  fields.read("device_bytes", request.device_bytes);
  const auto action = std::ranges::find(kSliceActions, type);
  if (action == kSliceActions.end()) {
    fields.fail("type", "slice_take, slice_renew or slice_give", type);
  }
  VOXELD_TRY(fields.finish());
  VOXELD_TRY(check_bounds(request));
  request.action = static_cast<SliceAction>(action - kSliceActions.begin());
  return request;
}

Json to_json_message(const SliceReply& reply) {
  Json message = {{"granted", reply.granted}, {"cancel", reply.cancel}, {"fenced", reply.fenced}};
  if (reply.error) message["error"] = error_json(*reply.error);
  return message;
}

Result<SliceReply> parse_slice_reply(const Json& message) {
  SliceReply reply;
  JsonFields fields(message, "reply");
  fields.require({"granted", "cancel", "fenced"});
  fields.read("granted", reply.granted);
  fields.read("cancel", reply.cancel);
  fields.read("fenced", reply.fenced);
  const Json* error = fields.member("error");
  VOXELD_TRY(fields.finish());
  if (error != nullptr) reply.error = parse_error_json(*error);
  return reply;
}

}  // namespace voxeld
