// A worker without a GPU: speaks the task API and does what the test, or the task's file name,
// says.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "proto/messages/sequence.h"
#include "proto/messages/task_api.h"
#include "server/process/frame_socket.h"

namespace voxeld::testing {

class FakeWorker {
 public:
  // Connects and says hello. Aborts when it cannot, and later when a reply takes longer than
  // `patience` (0: any time).
  FakeWorker(const std::filesystem::path& socket, const std::string& device,
             std::chrono::seconds patience = std::chrono::seconds(0));
  // The same; nullopt when the gateway has ended the worker before it replied.
  static std::optional<FakeWorker> try_connect(const std::filesystem::path& socket,
                                               const std::string& device,
                                               std::chrono::seconds patience);

  // Sends one request and returns the reply; nullopt when the gateway has closed the connection.
  std::optional<nlohmann::json> call(const nlohmann::json& request);
  // The same of any text.
  std::optional<nlohmann::json> send_text(const std::string& text);
  int fd() const { return socket_->fd(); }
  // Blocks until there is a task; nullopt when the gateway stops.
  std::optional<Task> claim();
  TaskProgressReply progress(const Task& task, const std::string& stage, int64_t done,
                             int64_t total);
  // Writes `text` as the container of a frame and reports it.
  TaskFrameReply frame(const Task& task, int64_t index, const std::string& text,
                       int64_t frames_total = 0);
  // Writes `container` as a part of the task's grid and reports it.
  TaskPartReply part(const Task& task, int64_t position, std::string_view container);
  // Completes with `text` as the result and with the manifest of frames of these texts.
  nlohmann::json complete_sequence(const Task& task, const std::vector<std::string>& frames,
                                   const std::string& text);
  // Writes `text` as the result (and as the grid) and completes. Returns false when fenced.
  bool complete(const Task& task, const std::string& text);
  bool fail(const Task& task, const Error& error);
  // Sends `completion` as it is.
  nlohmann::json complete_with(const TaskCompletion& completion);
  std::filesystem::path write(const std::string& name, std::string_view text);
  const std::filesystem::path& scratch() const { return scratch_; }
  // The path of a task's blob for this worker, valid while the task runs.
  std::string input(const std::string& blob) const {
    return (scratch_.parent_path() / "in" / blob).string();
  }

 private:
  FakeWorker() = default;
  bool say_hello(const std::filesystem::path& socket, const std::string& device,
                 std::chrono::seconds patience);

  std::unique_ptr<FrameSocket> socket_;
  std::filesystem::path scratch_;
};

// The frame that FakeWorker::frame() reports: 24 in a second, as many voxels as bytes.
SequenceFrame fake_frame(int64_t index, const std::string& text);

// Claims and runs until the gateway stops. A task's file name decides: "crash…" kills the process
// (SIGKILL), "fail…" fails, "slow…" reports progress until it is cancelled, "deaf…" reports and
// ignores the cancel, "stuck…" reports the same for ever, "pid…" completes with the number of its
// process, anything else completes at once.
int fake_worker_main(const std::string& gateway, const std::string& device);

}  // namespace voxeld::testing
