// Workers that a hostile file has taken over: each says over its socket what no worker would say.
// The worker's connection ends, its job is tried again as after a crash, and others go on.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "proto/container/grid_format.h"
#include "server/jobs/workers/task_server.h"
#include "tests/unit/base/comes_true.h"
#include "tests/unit/base/temporary_dir.h"
#include "tests/unit/jobs/fake_worker.h"
#include "tests/unit/jobs/wait_job.h"

namespace voxeld {
namespace {

using nlohmann::json;
using testing::FakeWorker;
using Clock = JobService::Clock;

std::string repeated(std::string_view text, size_t count) {
  std::string all;
  all.reserve(text.size() * count);
  for (size_t i = 0; i < count; ++i) all += text;
  return all;
}

TaskCompletion done(FakeWorker& worker, const Task& task) {
  TaskCompletion completion;
  completion.task = task.id;
  completion.fence = task.fence;
  completion.outputs = {
      {"result", worker.write("result", "voxels").string(), "application/x-npy", "bunny.npy"}};
  return completion;
}

class HostileWorkerTest : public ::testing::Test {
 protected:
  void SetUp() override { start(); }
  void start() {
    service_.reset();
    JobServiceConfig config;
    config.data_dir = dir_.path() / "data";
    config.start_workers = false;
    config.limits = limits_;
    auto service = start_job_service(config, nullptr);
    ASSERT_TRUE(service) << service.error().message();
    service_ = *std::move(service);
  }
  std::filesystem::path socket() const { return dir_.path() / "data/run/tasks.sock"; }
  FakeWorker connect() { return {socket(), "llvmpipe", testing::kPatience}; }
  std::string submit(const std::string& text) {
    auto writer = service_->begin_upload(1 << 20);
    EXPECT_TRUE(writer);
    EXPECT_TRUE(writer->append({reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
    JobRequest request;
    request.asset =
        service_->put_asset(Caller::open(), writer->finish().value(), "bunny.ply", "").value().id;
    request.options.use_cache = false;
    return service_->submit(Caller::open(), request, {}).value().id;
  }
  JobStatus get(const std::string& id) { return service_->get(Caller::open(), id).value(); }
  JobStatus wait_end(const std::string& id) {
    return testing::wait_end(*service_, Caller::open(), id).value();
  }
  // Gives the job to three workers, one after the other, each of which does `attack`; then looks
  // whether others are served. `why`: what the job's error says of each of them.
  void expect_refused(const std::function<void(FakeWorker&, const Task&)>& attack,
                      const std::string& why) {
    const std::string id = submit("hostile mesh");
    for (int attempt = 1; attempt <= limits::kJobAttemptsMax; ++attempt) {
      FakeWorker worker = connect();
      const auto task = worker.claim();
      ASSERT_TRUE(task) << "attempt " << attempt;
      EXPECT_EQ(task->attempt, attempt);
      attack(worker, *task);
      if (HasFailure()) return;
    }
    const JobStatus status = wait_end(id);
    ASSERT_EQ(status.state, JobState::kFailed);
    EXPECT_EQ(status.error->code, ErrorCode::kWorkerCrashed);
    EXPECT_TRUE(status.error->detail.starts_with("the job ended 3 workers: " + why))
        << status.error->detail.substr(0, 600);
    const std::string other = submit("mesh");
    FakeWorker good = connect();
    const auto task = good.claim();
    ASSERT_TRUE(task);
    EXPECT_TRUE(good.complete(*task, "fine"));
    EXPECT_EQ(wait_end(other).state, JobState::kDone);
  }
  // The same of one message.
  void expect_message_refused(const std::function<json(FakeWorker&, const Task&)>& message,
                              const std::string& why) {
    expect_refused(
        [&](FakeWorker& worker, const Task& task) {
          const auto reply = worker.call(message(worker, task));
          EXPECT_FALSE(reply) << "replied with " << reply->dump();
        },
        why);
  }
  void expect_completion_refused(const std::function<void(TaskCompletion&)>& change,
                                 const std::string& why) {
    expect_message_refused(
        [&](FakeWorker& worker, const Task& task) {
          TaskCompletion completion = done(worker, task);
          change(completion);
          return to_json_message(completion);
        },
        why);
  }

  testing::TemporaryDir dir_;
  TaskLimits limits_;
  std::unique_ptr<JobService> service_;
};

TEST_F(HostileWorkerTest, meta_of_60000_levels) {
  const std::string meta = R"({"a":)" + repeated("[", 60'000) + repeated("]", 60'000) + "}";
  expect_completion_refused([&](TaskCompletion& all) { all.meta_json = meta; },
                            "complete.meta_json: JSON: depth of nesting is over the limit");
}

// Files that were taken count, and refused ones are removed.
TEST_F(HostileWorkerTest, parts_that_are_no_containers_do_not_pile_up) {
  submit("mesh");
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  for (int i = 0; i < 3; ++i) EXPECT_NE(worker.part(*task, 0, "no container").error, "");
  EXPECT_TRUE(std::filesystem::is_empty(worker.scratch().parent_path() / "taken"));
}

TEST_F(HostileWorkerTest, parts_of_a_job_take_no_more_than_one_worker_may_write) {
  limits_.scratch_bytes_max = 250'000;
  start();
  submit("mesh");
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  GridHeader header;
  header.dims = {1, 1, 1};
  header.voxel_size = {1, 1, 1};
  header.meta_json = R"({"a":")" + repeated("x", 100'000) + "\"}";
  const auto bytes = encode_grid(header, {}).value();
  const std::string container(bytes.begin(), bytes.end());
  for (int i = 0; i < 2; ++i) EXPECT_EQ(worker.part(*task, i, container).error, "");
  EXPECT_NE(worker.part(*task, 2, container).error.find("more than one worker may write"),
            std::string::npos);
  EXPECT_EQ(worker.part(*task, 1, container).error, "") << "it replaces one";
}

TEST_F(HostileWorkerTest, meta_of_two_megabytes) {
  const std::string meta = R"({"a":")" + repeated("x", 2'000'000) + "\"}";
  expect_completion_refused([&](TaskCompletion& all) { all.meta_json = meta; },
                            "complete.meta_json: JSON body is too large");
}

TEST_F(HostileWorkerTest, meta_of_300000_values) {
  const std::string meta = R"({"a":[)" + repeated("0,", 300'000) + "0]}";
  expect_completion_refused([&](TaskCompletion& all) { all.meta_json = meta; },
                            "complete.meta_json: JSON: too many values");
}

TEST_F(HostileWorkerTest, meta_that_is_no_object) {
  expect_completion_refused([](TaskCompletion& all) { all.meta_json = "[1, 2]"; },
                            "complete.meta_json: expected an object, got array");
}

TEST_F(HostileWorkerTest, a_hundred_thousand_warnings) {
  expect_completion_refused(
      [](TaskCompletion& all) {
        all.warnings.assign(100'000, Warning{"a", ""});
      },
      "JSON: too many values: expected at most 4096, got more");
}

TEST_F(HostileWorkerTest, a_warning_of_100_kilobytes) {
  expect_completion_refused(
      [](TaskCompletion& all) {
        all.warnings = {{"long", std::string(100'000, 'x')}};
      },
      "complete.warnings[0].detail: expected at most 2000 bytes, got 100000");
}

// Each stage is a time series of the metrics.
TEST_F(HostileWorkerTest, timings_of_stages_that_there_are_not) {
  expect_completion_refused(
      [](TaskCompletion& all) {
        all.timings = {{"stage-4711", 1.0}};
      },
      "complete.timings: expected parse, place, voxelize, render, encode or inspect, "
      "got stage-4711");
}

TEST_F(HostileWorkerTest, timings_that_are_no_times) {
  expect_completion_refused(
      [](TaskCompletion& all) {
        all.timings = {{"parse", -1e300}};
      },
      "complete.timings of parse: expected milliseconds from 0 to ");
}

// A browser would run it in the name of the service.
TEST_F(HostileWorkerTest, a_result_that_says_it_is_a_web_page) {
  expect_completion_refused(
      [](TaskCompletion& all) { all.outputs[0].media_type = "text/html"; },
      "complete.outputs[0].media_type: expected that of a format of results, got text/html");
}

TEST_F(HostileWorkerTest, a_file_name_that_ends_the_header) {
  expect_completion_refused(
      [](TaskCompletion& all) { all.outputs[0].filename = "a\r\nSet-Cookie: b"; },
      "complete.outputs[0].filename: expected text without control characters");
}

TEST_F(HostileWorkerTest, ten_thousand_outputs) {
  expect_completion_refused([](TaskCompletion& all) { all.outputs.resize(10'000, all.outputs[0]); },
                            "");
}

TEST_F(HostileWorkerTest, a_stage_of_a_megabyte) {
  expect_message_refused(
      [](FakeWorker&, const Task& task) {
        return to_json_message(TaskProgress{.task = task.id,
                                            .fence = task.fence,
                                            .stage = std::string(1 << 20, 's'),
                                            .device_memory = {}});
      },
      "task message is too long: progress: expected at most ");
}

TEST_F(HostileWorkerTest, progress_below_zero) {
  expect_message_refused(
      [](FakeWorker&, const Task& task) {
        return to_json_message(TaskProgress{.task = task.id,
                                            .fence = task.fence,
                                            .stage = "parse",
                                            .tiles_done = -5,
                                            .tiles_total = 8,
                                            .device_memory = {}});
      },
      "progress.tiles_done: expected 0 to ");
}

TEST_F(HostileWorkerTest, an_error_of_two_megabytes) {
  expect_message_refused(
      [](FakeWorker&, const Task& task) {
        return to_json_message(TaskFailure{
            task.id, task.fence, {ErrorCode::kInternal, std::string(2'000'000, 'x'), "", ""}});
      },
      "task message is too long: fail: expected at most ");
}

// It is shown of that worker alone, in few words, and nothing depends on it.
TEST_F(HostileWorkerTest, a_worker_at_work_that_says_its_device_fails_harms_no_one) {
  FakeWorker worker = connect();
  const std::string id = submit("mesh");
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  const Error error{ErrorCode::kDeviceUnavailable, repeated("no ", 1500), "", ""};
  ASSERT_TRUE(worker.call(to_json_message(TaskFailure{"", 0, error})));
  FakeWorker other = connect();
  std::vector<size_t> lengths;
  for (const WorkerState& state : service_->workers())
    lengths.push_back(state.device_failure.size());
  std::ranges::sort(lengths);
  EXPECT_EQ(lengths, (std::vector<size_t>{0, 2000}));
  EXPECT_TRUE(service_->ready());
  EXPECT_TRUE(worker.complete(*task, "fine"));
  EXPECT_EQ(wait_end(id).state, JobState::kDone);
}

TEST_F(HostileWorkerTest, a_message_of_a_million_values) {
  expect_refused(
      [](FakeWorker& worker, const Task&) {
        EXPECT_FALSE(
            worker.send_text(R"({"type":"progress","a":[)" + repeated("0,", 1'000'000) + "0]}"));
      },
      "");
}

TEST_F(HostileWorkerTest, a_sequence_whose_meta_has_a_million_members) {
  const std::string id = submit("hostile mesh");
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  std::string members;
  for (int i = 0; i < 500'000; ++i) members += ",\"" + std::to_string(i) + "\":0";
  const std::string grid = "sha256-" + repeated("0", 64);
  const std::string manifest =
      R"({"dims":[1,1,1],"origin":[0,0,0],"voxel_size":[1,1,1],"channels":[],"fps":24,)"
      R"("frames":[{"time_s":0,"grid":")" +
      grid + R"(","voxel_count":1,"content_hash":")" + grid + R"("}],"meta":{)" +
      members.substr(1) + "}}";
  TaskCompletion completion = done(worker, *task);
  completion.outputs.push_back(
      {"sequence", worker.write("manifest", manifest).string(), "application/json", "a.json"});
  const auto begun = Clock::now();
  worker.complete_with(completion);
  const double took = std::chrono::duration<double>(Clock::now() - begun).count();
  const JobStatus status = wait_end(id);
  ASSERT_EQ(status.state, JobState::kFailed);
  EXPECT_TRUE(status.error->message().starts_with(
      "worker brings a sequence: JSON: too many members in one object"))
      << status.error->message() << " after " << took << " s";
}

// One byte after the other, each in time: the job would be held for days. At a byte each 2 ms the
// message would last for two minutes.
TEST_F(HostileWorkerTest, a_message_that_trickles) {
  limits_.message_seconds_max = 1;
  start();
  expect_refused(
      [](FakeWorker& worker, const Task&) {
        const std::string head("\xff\xff\x00\x00", 4);
        ASSERT_EQ(::send(worker.fd(), head.data(), 4, MSG_NOSIGNAL), 4);
        EXPECT_TRUE(
            testing::comes_true([&] { return ::send(worker.fd(), " ", 1, MSG_NOSIGNAL) != 1; }));
      },
      "task message takes too long: expected its 65535 bytes within 1 s, got ");
}

TEST_F(HostileWorkerTest, replies_that_are_never_read) {
  limits_.message_seconds_max = 1;
  start();
  expect_refused(
      [](FakeWorker& worker, const Task& task) {
        const std::string text =
            to_json_message(
                TaskProgress{
                    .task = task.id, .fence = task.fence, .stage = "parse", .device_memory = {}})
                .dump();
        std::string frame(4, '\0');
        frame[0] = static_cast<char>(text.size() & 0xff);
        frame[1] = static_cast<char>(text.size() >> 8);
        frame += text;
        EXPECT_TRUE(testing::comes_true([&] {
          ssize_t sent = 1;
          for (int i = 0; i < 100 && sent > 0; ++i) {
            sent = ::send(worker.fd(), frame.data(), frame.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
            if (sent > 0 && sent < std::ssize(frame)) frame = frame.substr(sent);
          }
          return sent < 0 && errno != EAGAIN;
        }));
      },
      "");
}

TEST_F(HostileWorkerTest, more_reports_than_a_worker_has_to_tell) {
  limits_.messages_per_second_max = 0;  // with a rate, a slow machine would send more
  limits_.messages_at_once_max = 100;
  start();
  expect_refused(
      [](FakeWorker& worker, const Task& task) {
        const json report = to_json_message(TaskProgress{
            .task = task.id, .fence = task.fence, .stage = "parse", .device_memory = {}});
        int replies = 0;
        while (replies < 1000 && worker.call(report)) ++replies;
        EXPECT_EQ(replies, 99) << "the claim counts, too";
      },
      "too many task messages: expected at most 0 in a second, got more");
}

// Before it has a task: nothing is tried again, and others go on.
TEST_F(HostileWorkerTest, a_hello_of_any_size_or_depth) {
  WorkerHello hello;
  hello.pid = 1;
  hello.device = "llvmpipe";
  hello.renderer = "r";
  const auto refuses = [&](const WorkerHello& said) {
    FrameSocket raw(connect_unix(socket()).value(), kTaskFrameBytesMax);
    EXPECT_TRUE(raw.send(to_json_message(said).dump()));
    return !raw.receive();
  };
  hello.device_json = R"({"a":)" + repeated("[", 60'000) + repeated("]", 60'000) + "}";
  EXPECT_TRUE(refuses(hello));
  hello.device_json = "{}";
  hello.renderer = std::string(100'000, 'r');
  EXPECT_TRUE(refuses(hello));
  hello.renderer = "a\nb";
  EXPECT_TRUE(refuses(hello));
  EXPECT_TRUE(service_->workers().empty());
}

}  // namespace
}  // namespace voxeld
