#include "tests/unit/jobs/fake_worker.h"

#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <span>
#include <thread>

#include "server/base/check.h"
#include "server/base/disk/file.h"
#include "server/base/sha256.h"

namespace voxeld::testing {

using nlohmann::json;

FakeWorker::FakeWorker(const std::filesystem::path& socket, const std::string& device,
                       std::chrono::seconds patience) {
  VOXELD_CHECK(say_hello(socket, device, patience), "hello got no reply");
}

std::optional<FakeWorker> FakeWorker::try_connect(const std::filesystem::path& socket,
                                                  const std::string& device,
                                                  std::chrono::seconds patience) {
  FakeWorker worker;
  if (!worker.say_hello(socket, device, patience)) return std::nullopt;
  return worker;
}

bool FakeWorker::say_hello(const std::filesystem::path& socket, const std::string& device,
                           std::chrono::seconds patience) {
  auto fd = connect_unix(socket);
  VOXELD_CHECK(fd.ok(), fd.error().detail);
  socket_ = std::make_unique<FrameSocket>(*std::move(fd), kTaskFrameBytesMax);
  if (patience.count() > 0) {
    const Status limited = socket_->set_receive_timeout(static_cast<double>(patience.count()));
    VOXELD_CHECK(limited.ok(), limited.error().detail);
  }
  WorkerHello hello;
  hello.pid = ::getpid();
  hello.device = device;
  hello.renderer = "fake renderer";
  hello.driver = "fake driver 1.0";
  hello.device_json = "{}";
  const auto reply = call(to_json_message(hello));
  if (!reply) return false;
  scratch_ = reply->value("scratch_dir", "");
  return true;
}

std::optional<json> FakeWorker::call(const json& request) {
  return send_text(request.dump());
}

std::optional<json> FakeWorker::send_text(const std::string& text) {
  if (!socket_->send(text)) return std::nullopt;
  const auto frame = socket_->receive();
  VOXELD_CHECK(frame || frame.error().code != ErrorCode::kDeadlineExceeded,
               "the gateway does not reply");
  if (!frame) return std::nullopt;
  return json::parse(*frame);
}

std::optional<Task> FakeWorker::claim() {
  const auto reply = call({{"type", "claim"}});
  if (!reply || !reply->contains("task")) return std::nullopt;
  auto task = parse_task((*reply)["task"]);
  VOXELD_CHECK(task.ok(), task.error().detail);
  return *std::move(task);
}

TaskProgressReply FakeWorker::progress(const Task& task, const std::string& stage, int64_t done,
                                       int64_t total) {
  const auto reply =
      call(to_json_message(TaskProgress{task.id, task.fence, stage, done, total, 0, 0, {}}));
  if (!reply) return {false, true};
  return {reply->value("cancel", false), reply->value("fenced", false)};
}

json FakeWorker::complete_with(const TaskCompletion& completion) {
  return call(to_json_message(completion)).value_or(json::object());
}

std::filesystem::path FakeWorker::write(const std::string& name, std::string_view text) {
  auto path = scratch_ / name;
  const auto written =
      write_file(path, std::span(reinterpret_cast<const uint8_t*>(text.data()), text.size()));
  // The folder goes with the session, which a limit may have ended.
  VOXELD_CHECK(written.ok() || !std::filesystem::exists(scratch_), written.error().detail);
  return path;
}

SequenceFrame fake_frame(int64_t index, const std::string& text) {
  return {static_cast<double>(index) / 24.0, sha256_id(text), text.size(),
          sha256_id("content of " + text)};
}

TaskFrameReply FakeWorker::frame(const Task& task, int64_t index, const std::string& text,
                                 int64_t frames_total) {
  const SequenceFrame made = fake_frame(index, text);
  const std::string path = write("frame.voxg", text).string();
  const auto reply =
      call(to_json_message(TaskFrame{task.id, task.fence, index, made.time_s, path,
                                     made.voxel_count, made.content_hash, frames_total}));
  VOXELD_CHECK(reply.has_value(), "a frame got no reply");
  auto parsed = parse_task_frame_reply(*reply);
  VOXELD_CHECK(parsed.ok(), parsed.error().detail);
  return *std::move(parsed);
}

TaskPartReply FakeWorker::part(const Task& task, int64_t position, std::string_view container) {
  const std::string path = write("part.voxg", container).string();
  const auto reply = call(to_json_message(TaskPart{task.id, task.fence, position, path}));
  VOXELD_CHECK(reply.has_value(), "a part got no reply");
  auto parsed = parse_task_part_reply(*reply);
  VOXELD_CHECK(parsed.ok(), parsed.error().detail);
  return *std::move(parsed);
}

json FakeWorker::complete_sequence(const Task& task, const std::vector<std::string>& frames,
                                   const std::string& text) {
  SequenceManifest manifest;
  manifest.dims = {4, 5, 6};
  manifest.voxel_size = {0.5, 0.5, 0.5};
  manifest.channels.color = true;
  manifest.fps = 24;
  for (const std::string& frame : frames) {
    manifest.frames.push_back(fake_frame(static_cast<int64_t>(manifest.frames.size()), frame));
  }
  TaskCompletion completion;
  completion.task = task.id;
  completion.fence = task.fence;
  completion.outputs = {{"sequence", write("manifest.json", sequence_json(manifest)).string(),
                         "application/json", "bob.json"},
                        {"result", write("result.bin", text).string(),
                         "application/vnd.voxeld.sequence", "bob.voxs"}};
  return complete_with(completion);
}

bool FakeWorker::complete(const Task& task, const std::string& text) {
  const auto path = write("result.bin", text);
  TaskCompletion completion;
  completion.task = task.id;
  completion.fence = task.fence;
  completion.outputs = {{"result", path.string(), "application/x-npy", "result.npy"},
                        {"grid", path.string(), "application/x-npy", "result.npy"}};
  completion.timings = {{"parse", 1.5}, {"voxelize", 2.5}};
  completion.meta_json = R"({"voxel_count":7})";
  completion.warnings = {{"missing-texture", "a.png"}};
  return complete_with(completion).value("ok", false);
}

bool FakeWorker::fail(const Task& task, const Error& error) {
  const auto reply = call(to_json_message(TaskFailure{task.id, task.fence, error}));
  return reply && reply->value("ok", false);
}

namespace {

// Reports until it is cancelled (or, when deaf, for ever), with progress unless it is stuck.
// Returns false when the gateway is gone.
bool run_slowly(FakeWorker& worker, const Task& task) {
  const bool deaf = task.filename.starts_with("deaf");
  const int64_t step = task.filename.starts_with("stuck") ? 0 : 1;
  for (int64_t tile = 0;; tile += step) {
    const TaskProgressReply reply = worker.progress(task, "voxelize", tile, 1'000'000);
    if (reply.fenced) return false;
    if (reply.cancel && !deaf) {
      return worker.fail(task, {ErrorCode::kCancelled, "the job was cancelled", "", ""});
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

}  // namespace

int fake_worker_main(const std::string& gateway, const std::string& device) {
  if (device == "broken") return 3;
  FakeWorker worker(gateway.substr(std::string("unix:").size()), device);
  while (auto task = worker.claim()) {
    const std::string& name = task->filename;
    if (name.starts_with("crash")) {
      ::kill(::getpid(), SIGKILL);
    } else if (name.starts_with("fail")) {
      worker.fail(*task, {ErrorCode::kMalformedMesh, name + " line 1: no", "yes", "no"});
    } else if (name.starts_with("slow") || name.starts_with("deaf") || name.starts_with("stuck")) {
      if (!run_slowly(worker, *task)) return 0;
    } else if (name.starts_with("pid")) {
      worker.complete(*task, std::to_string(::getpid()));
    } else {
      worker.complete(*task, "result of " + task->id);
    }
  }
  return 0;
}

}  // namespace voxeld::testing
