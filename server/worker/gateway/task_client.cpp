#include "server/worker/gateway/task_client.h"

#include <nlohmann/json.hpp>
#include <type_traits>

namespace voxeld {

using nlohmann::json;

namespace {
constexpr std::string_view kUnixScheme = "unix:";
}  // namespace

Result<UniqueFd> connect_gateway(const std::string& gateway) {
  if (!gateway.starts_with(kUnixScheme)) {
    return Error{ErrorCode::kInvalidOption, "cannot reach this gateway", "unix:/path/to/tasks.sock",
                 gateway};
  }
  return connect_unix(gateway.substr(kUnixScheme.size()));
}

Result<std::unique_ptr<TaskClient>> TaskClient::connect(const std::string& gateway) {
  VOXELD_ASSIGN(UniqueFd fd, connect_gateway(gateway));
  return std::unique_ptr<TaskClient>(new TaskClient(std::move(fd)));
}

Result<json> TaskClient::call(const json& request) {
  std::string frame;
  {
    MutexLock lock(mutex_);
    VOXELD_TRY(socket_.send(request.dump(-1, ' ', false, json::error_handler_t::replace)));
    VOXELD_ASSIGN(frame, socket_.receive());
  }
  VOXELD_ASSIGN(json reply, parse_task_message(frame));
  if (!reply.is_object()) {
    return Error{ErrorCode::kInternal, "the gateway's reply is not an object", "", ""};
  }
  return reply;
}

Result<WorkerFolders> TaskClient::prepare() {
  VOXELD_ASSIGN(const json reply, call({{"type", "prepare"}}));
  return parse_worker_folders(reply);
}

Result<std::string> TaskClient::hello(const WorkerHello& hello) {
  VOXELD_ASSIGN(const json reply, call(to_json_message(hello)));
  return reply.value("scratch_dir", "");
}

Result<Task> TaskClient::claim() {
  VOXELD_ASSIGN(const json reply, call({{"type", "claim"}}));
  return parse_task(reply.value("task", json::object()));
}

Result<TaskProgressReply> TaskClient::progress(const TaskProgress& progress) {
  VOXELD_ASSIGN(const json reply, call(to_json_message(progress)));
  return parse_task_progress_reply(reply);
}

Result<TaskFrameReply> TaskClient::frame(const TaskFrame& frame) {
  VOXELD_ASSIGN(const json reply, call(to_json_message(frame)));
  return parse_task_frame_reply(reply);
}

Result<TaskPartReply> TaskClient::part(const TaskPart& part) {
  VOXELD_ASSIGN(const json json_reply, call(to_json_message(part)));
  VOXELD_ASSIGN(TaskPartReply reply, parse_task_part_reply(json_reply));
  if (reply.error.empty()) return reply;
  return Error{ErrorCode::kInternal, "the gateway: " + reply.error, "", ""};
}

Result<bool> TaskClient::report(const TaskOutcome& outcome) {
  return std::visit(
      [this]<typename Report>(const Report& report) -> Result<bool> {
        if constexpr (std::is_same_v<Report, TaskDropped>) {
          return false;
        } else {
          VOXELD_ASSIGN(const json reply, call(to_json_message(report)));
          return reply.value("ok", false);
        }
      },
      outcome);
}

}  // namespace voxeld
