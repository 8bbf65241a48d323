#include "proto/messages/task_bounds.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "proto/blob_id.h"
#include "proto/container/sequence_format.h"
#include "proto/limits.h"
#include "proto/messages/json_bounds.h"

namespace voxeld {
namespace {

using Json = nlohmann::json;

// The stages that workers measure. Each is a time series of voxeld_stage_seconds, so the set is
// closed.
constexpr std::array<std::string_view, 6> kStages = {"parse",  "place",  "voxelize",
                                                     "render", "encode", "inspect"};
constexpr std::string_view kStageList = "parse, place, voxelize, render, encode or inspect";
constexpr std::array<std::string_view, 3> kRoles = {"result", "grid", "sequence"};
// Media types beside those of grids and sequences.
constexpr std::array<std::string_view, 4> kMediaTypes = {"application/json", "image/apng",
                                                         "image/gif", "image/png"};

Error out_of_bounds(std::string_view what, std::string expected, std::string got) {
  return {ErrorCode::kBadRequest, std::string(what), std::move(expected), std::move(got)};
}

std::string shown(std::string_view text) {
  std::string out(text.substr(0, 80));
  for (char& c : out) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  }
  return out;
}

Status check_length(std::string_view what, std::string_view text, size_t bytes_max) {
  if (text.size() <= bytes_max) return {};
  return out_of_bounds(what, "at most " + std::to_string(bytes_max) + " bytes",
                       std::to_string(text.size()));
}

// Checks a text that appears in headers, labels and log lines.
Status check_name(std::string_view what, std::string_view text,
                  size_t bytes_max = limits::kTaskNameBytesMax) {
  VOXELD_TRY(check_length(what, text, bytes_max));
  const bool is_plain = std::ranges::none_of(
      text, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; });
  if (is_plain) return {};
  return out_of_bounds(what, "text without control characters", shown(text));
}

Status check_path(std::string_view what, std::string_view text) {
  return check_length(what, text, limits::kTaskPathBytesMax);
}

Status check_count(std::string_view what, size_t count, size_t count_max) {
  if (count <= count_max) return {};
  return out_of_bounds(what, "at most " + std::to_string(count_max), std::to_string(count));
}

Status check_range(std::string_view what, int64_t value, int64_t max) {
  if (value >= 0 && value <= max) return {};
  return out_of_bounds(what, "0 to " + std::to_string(max), std::to_string(value));
}

template <size_t Count>
bool is_one_of(std::string_view text, const std::array<std::string_view, Count>& known) {
  return std::ranges::find(known, text) != known.end();
}

bool is_media_type(std::string_view type) {
  for (const FormatInfo& format : output_formats()) {
    if (type == format.media_type || type == format.sequence_media_type) return true;
  }
  return is_one_of(type, kMediaTypes);
}

// Checks that the text is a JSON object within the bounds. The values are built only to be dropped.
Status check_object(std::string_view what, std::string_view text, const JsonBounds& bounds) {
  auto object = parse_json_bounded(text, bounds);
  if (!object) {
    Error error = std::move(object).error();
    error.code = ErrorCode::kBadRequest;
    error.detail = std::string(what) + ": " + error.detail;
    return error;
  }
  if (object->is_object()) return {};
  return out_of_bounds(what, "an object", object->type_name());
}

Status check_timings(const StageTimes& timings) {
  VOXELD_TRY(check_count("timings", timings.size(), limits::kTaskTimingsMax));
  for (const auto& [stage, ms] : timings) {
    if (!is_one_of(stage, kStages)) {
      return out_of_bounds("timings", std::string(kStageList), shown(stage));
    }
    if (!(ms >= 0 && ms <= limits::kStageMsMax)) {
      return out_of_bounds("timings of " + stage, "milliseconds from 0 to 1e10",
                           std::to_string(ms));
    }
  }
  return {};
}

Status check_output(const TaskOutput& output) {
  if (!is_one_of(output.role, kRoles)) {
    return out_of_bounds("complete.outputs.role", "result, grid or sequence", shown(output.role));
  }
  VOXELD_TRY(check_path("complete.outputs.path", output.path));
  VOXELD_TRY(check_name("complete.outputs.filename", output.filename, limits::kTaskTextBytesMax));
  if (is_media_type(output.media_type)) return {};
  return out_of_bounds("complete.outputs.media_type", "that of a format of results",
                       shown(output.media_type));
}

std::string type_of(const Json& message) {
  const auto type = message.is_object() ? message.find("type") : message.end();
  return type != message.end() && type->is_string() ? type->get<std::string>() : std::string();
}

}  // namespace

Result<Json> parse_worker_message(std::string_view text) {
  VOXELD_ASSIGN(Json message, parse_json_bounded(
                                  text, JsonBounds{.bytes_max = limits::kWorkerMessageBytesMax,
                                                   .depth_max = limits::kWorkerMessageDepthMax,
                                                   .values_max = limits::kWorkerMessageValuesMax}));
  const std::string type = type_of(message);
  if (type == "complete" || text.size() <= limits::kWorkerReportBytesMax) return message;
  return out_of_bounds("task message is too long: " + shown(type),
                       "at most " + std::to_string(limits::kWorkerReportBytesMax) + " bytes",
                       std::to_string(text.size()));
}

Status check_bounds(const WorkerHello& hello) {
  VOXELD_TRY(check_name("hello.device", hello.device));
  VOXELD_TRY(check_name("hello.renderer", hello.renderer));
  VOXELD_TRY(check_name("hello.driver", hello.driver));
  VOXELD_TRY(check_name("hello.sandbox", hello.sandbox));
  if (hello.device_json.empty()) return {};
  return check_object("hello.device_json", hello.device_json,
                      {.bytes_max = limits::kDeviceJsonBytesMax,
                       .depth_max = limits::kMetaDepthMax,
                       .values_max = limits::kDeviceJsonValuesMax});
}

Status check_bounds(const TaskProgress& progress) {
  if (!progress.stage.empty() && !is_one_of(progress.stage, kStages)) {
    return out_of_bounds("progress.stage", std::string(kStageList), shown(progress.stage));
  }
  VOXELD_TRY(check_range("progress.tiles_done", progress.tiles_done, limits::kTilesMax));
  VOXELD_TRY(check_range("progress.tiles_total", progress.tiles_total, limits::kTilesMax));
  VOXELD_TRY(check_range("progress.frames_done", progress.frames_done, limits::kFramesMax));
  VOXELD_TRY(check_range("progress.frames_total", progress.frames_total, limits::kFramesMax));
  const DeviceMemory& memory = progress.device_memory;
  VOXELD_TRY(
      check_range("progress.device_bytes_total", memory.bytes_total, limits::kMemoryBytesMax));
  VOXELD_TRY(check_range("progress.device_bytes_free", memory.bytes_free, limits::kMemoryBytesMax));
  return check_range("progress.preparation_ms", progress.preparation_ms,
                     static_cast<int64_t>(limits::kStageMsMax));
}

Status check_bounds(const TaskFrame& frame) {
  VOXELD_TRY(check_path("frame.path", frame.path));
  if (!std::isfinite(frame.time_s) || frame.time_s < 0) {
    return out_of_bounds("frame.time_s", "seconds from 0 on", std::to_string(frame.time_s));
  }
  if (is_blob_id(frame.content_hash)) return {};
  return out_of_bounds("frame.content_hash", "sha256- and 64 hex digits",
                       shown(frame.content_hash));
}

Status check_bounds(const TaskPart& part) {
  return check_path("part.path", part.path);
}

Status check_bounds(const TaskCompletion& completion) {
  VOXELD_TRY(check_count("complete.outputs", completion.outputs.size(), limits::kTaskOutputsMax));
  for (const TaskOutput& output : completion.outputs) VOXELD_TRY(check_output(output));
  VOXELD_TRY(check_timings(completion.timings));
  VOXELD_TRY(
      check_count("complete.warnings", completion.warnings.size(), limits::kTaskWarningsMax));
  for (const Warning& warning : completion.warnings) {
    VOXELD_TRY(check_name("warning.code", warning.code));
    VOXELD_TRY(check_length("warning.detail", warning.detail, limits::kTaskTextBytesMax));
  }
  return check_object("complete.meta_json", completion.meta_json,
                      {.bytes_max = limits::kMetaBytesMax,
                       .depth_max = limits::kMetaDepthMax,
                       .values_max = limits::kMetaValuesMax,
                       .members_max = limits::kMetaMembersMax});
}

Status check_bounds(const TaskPreemption& preempt) {
  VOXELD_TRY(check_range("preempt.tiles_total", preempt.tiles_total, limits::kTilesMax));
  return check_timings(preempt.timings);
}

Status check_bounds(const TaskFailure& failure) {
  VOXELD_TRY(check_length("fail.error.detail", failure.error.detail, limits::kTaskErrorBytesMax));
  VOXELD_TRY(
      check_length("fail.error.expected", failure.error.expected, limits::kTaskErrorBytesMax));
  return check_length("fail.error.got", failure.error.got, limits::kTaskErrorBytesMax);
}

Status check_bounds(const SlicesHello& hello) {
  return check_name("slices.device", hello.device);
}

Status check_bounds(const SliceRequest& request) {
  VOXELD_TRY(check_range("slice.host_bytes", request.host_bytes, limits::kMemoryBytesMax));
  return check_range("slice.device_bytes", request.device_bytes, limits::kMemoryBytesMax);
}

}  // namespace voxeld
