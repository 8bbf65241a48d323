#include "proto/messages/task_api.h"

#include <nlohmann/json.hpp>

#include "proto/messages/json_fields.h"
#include "proto/messages/task_fields.h"

namespace voxeld {
namespace {

using Json = nlohmann::json;

template <typename Message>
Result<Message> read_message(const Json& json) {
  Message message;
  VOXELD_TRY(read_fields(json, message));
  return message;
}

}  // namespace

Result<Json> parse_task_message(std::string_view text) {
  return parse_json_bounded(text, kTaskFrameBytesMax);
}

Json to_json_message(const WorkerHello& hello) {
  return fields_json<Json>(hello);
}
Result<WorkerHello> parse_worker_hello(const Json& message) {
  return read_message<WorkerHello>(message);
}

Json to_json_message(const WorkerFolders& folders) {
  return fields_json<Json>(folders);
}
Result<WorkerFolders> parse_worker_folders(const Json& message) {
  return read_message<WorkerFolders>(message);
}

Json to_json_message(const Task& task) {
  return fields_json<Json>(task);
}
Result<Task> parse_task(const Json& message) {
  return read_message<Task>(message);
}

Json to_json_message(const TaskProgress& progress) {
  return fields_json<Json>(progress);
}
Result<TaskProgress> parse_task_progress(const Json& message) {
  return read_message<TaskProgress>(message);
}

Json to_json_message(const TaskProgressReply& reply) {
  return fields_json<Json>(reply);
}
Result<TaskProgressReply> parse_task_progress_reply(const Json& message) {
  return read_message<TaskProgressReply>(message);
}

Json to_json_message(const TaskFrame& frame) {
  return fields_json<Json>(frame);
}
Result<TaskFrame> parse_task_frame(const Json& message) {
  return read_message<TaskFrame>(message);
}

Json to_json_message(const TaskFrameReply& reply) {
  return fields_json<Json>(reply);
}
Result<TaskFrameReply> parse_task_frame_reply(const Json& message) {
  return read_message<TaskFrameReply>(message);
}

Json to_json_message(const TaskPart& part) {
  return fields_json<Json>(part);
}
Result<TaskPart> parse_task_part(const Json& message) {
  return read_message<TaskPart>(message);
}

Json to_json_message(const TaskPartReply& reply) {
  return fields_json<Json>(reply);
}
Result<TaskPartReply> parse_task_part_reply(const Json& message) {
  return read_message<TaskPartReply>(message);
}

Json to_json_message(const TaskCompletion& completion) {
  return fields_json<Json>(completion);
}
Result<TaskCompletion> parse_task_completion(const Json& message) {
  return read_message<TaskCompletion>(message);
}

Json to_json_message(const TaskPreemption& preempt) {
  return fields_json<Json>(preempt);
}
Result<TaskPreemption> parse_task_preempt(const Json& message) {
  return read_message<TaskPreemption>(message);
}

Json to_json_message(const TaskFailure& failure) {
  return fields_json<Json>(failure);
}
Result<TaskFailure> parse_task_failure(const Json& message) {
  return read_message<TaskFailure>(message);
}

Json to_json_message(const SlicesHello& hello) {
  return fields_json<Json>(hello);
}
Result<SlicesHello> parse_slices_hello(const Json& message) {
  return read_message<SlicesHello>(message);
}

Json to_json_message(const SliceRequest& request) {
  return fields_json<Json>(request);
}
Result<SliceRequest> parse_slice_request(const Json& message) {
  return read_message<SliceRequest>(message);
}

Json to_json_message(const SliceReply& reply) {
  return fields_json<Json>(reply);
}
Result<SliceReply> parse_slice_reply(const Json& message) {
  return read_message<SliceReply>(message);
}

}  // namespace voxeld
