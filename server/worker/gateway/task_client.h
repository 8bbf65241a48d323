// The worker's side of the task API.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "proto/messages/task_api.h"
#include "server/base/thread_annotations.h"
#include "server/process/frame_socket.h"
#include "server/worker/gateway/task_outcome.h"

namespace voxeld {

// `gateway` is "unix:/path". Errors: invalid-option for other forms, internal.
Result<UniqueFd> connect_gateway(const std::string& gateway);

// One connection to the gateway. Thread-safe: each call is one request and its reply. All calls
// return the error `gone` once the gateway has closed the connection.
class TaskClient {
 public:
  // Errors: those of connect_gateway().
  static Result<std::unique_ptr<TaskClient>> connect(const std::string& gateway);

  // Call it before hello().
  Result<WorkerFolders> prepare();
  // Returns the directory for outputs.
  Result<std::string> hello(const WorkerHello& hello);
  // Blocks until there is a task.
  Result<Task> claim();
  Result<TaskProgressReply> progress(const TaskProgress& progress);
  Result<TaskFrameReply> frame(const TaskFrame& frame);
  Result<TaskPartReply> part(const TaskPart& part);
  // Returns true if the report counted, false if another worker owns the task. A dropped task is
  // not reported.
  Result<bool> report(const TaskOutcome& outcome);
  // For a signal handler: shutdown(2) on it ends every call.
  int fd() const { return fd_; }

 private:
  explicit TaskClient(UniqueFd fd) : fd_(fd.get()), socket_(std::move(fd), kTaskFrameBytesMax) {}
  Result<nlohmann::json> call(const nlohmann::json& request) EXCLUDES(mutex_);

  const int fd_;
  Mutex mutex_;
  FrameSocket socket_ GUARDED_BY(mutex_);
};

}  // namespace voxeld
