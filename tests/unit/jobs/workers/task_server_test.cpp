// The service with workers that the tests themselves play over the socket.
#include "server/jobs/workers/task_server.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>

#include "server/base/sha256.h"
#include "server/jobs/database/sqlite_connection.h"
#include "tests/unit/base/comes_true.h"
#include "tests/unit/base/temporary_dir.h"
#include "tests/unit/jobs/fake_worker.h"
#include "tests/unit/jobs/wait_job.h"

namespace voxeld {
namespace {

using nlohmann::json;
using testing::FakeWorker;
using Clock = JobService::Clock;
using std::chrono::milliseconds;

class TaskServerTest : public ::testing::Test {
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
  FakeWorker connect(const std::string& device = "llvmpipe") {
    return {socket(), device, testing::kPatience};
  }
  std::string put_asset(const std::string& text) {
    auto writer = service_->begin_upload(1 << 20);
    EXPECT_TRUE(writer);
    EXPECT_TRUE(writer->append({reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
    return service_->put_asset(Caller::open(), writer->finish().value(), "bunny.ply", "")
        .value()
        .id;
  }
  std::string submit(const std::string& text = "mesh") {
    JobRequest request;
    request.asset = put_asset(text);
    request.options.use_cache = false;
    auto status = service_->submit(Caller::open(), request, {});
    EXPECT_TRUE(status) << status.error().message();
    return status->id;
  }
  JobStatus wait_end(const std::string& id) {
    return testing::wait_end(*service_, Caller::open(), id).value();
  }
  JobStatus wait_for(const std::string& id, JobState state) {
    const auto deadline = Clock::now() + testing::kPatience;
    JobStatus status = service_->get(Caller::open(), id).value();
    while (status.state != state && Clock::now() < deadline) {
      status = testing::wait_change(*service_, Caller::open(), id, status.version,
                                    Clock::now() + milliseconds(100))
                   .value();
    }
    EXPECT_EQ(status.state, state);
    return status;
  }
  testing::TemporaryDir dir_;
  TaskLimits limits_;
  std::unique_ptr<JobService> service_;
};

TEST_F(TaskServerTest, a_task_names_its_input_and_ends_with_the_outputs_in_the_store) {
  const std::string id = submit();
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  EXPECT_EQ(task->id, id);
  EXPECT_EQ(task->fence, 1);
  EXPECT_EQ(task->attempt, 1);
  EXPECT_EQ(task->filename, "bunny.ply");
  EXPECT_EQ(task->input_hash, sha256_id("mesh"));
  EXPECT_FALSE(task->input_is_grid);
  EXPECT_EQ(read_file(task->input_path).value().size(), 4u);
  EXPECT_TRUE(worker.complete(*task, "voxels"));
  const JobStatus status = wait_end(id);
  ASSERT_EQ(status.state, JobState::kDone);
  EXPECT_EQ(status.result->blob, sha256_id("voxels"));
  EXPECT_EQ(status.result->grid, sha256_id("voxels"));
  EXPECT_EQ(service_->get_grid(Caller::open(), sha256_id("voxels")).value().bytes, 6);
  EXPECT_EQ(service_->get_grid(Caller::open(), sha256_id("mesh")).error().code,
            ErrorCode::kNotFound);
  EXPECT_EQ(status.timings.back().first, "store");
  EXPECT_TRUE(std::filesystem::is_empty(worker.scratch()));
}

TEST_F(TaskServerTest, a_worker_has_the_inputs_of_its_task_and_no_others) {
  const std::string first = submit("mesh"), second = submit("another mesh");
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  const std::filesystem::path folder = std::filesystem::path(task->input_path).parent_path();
  EXPECT_EQ(folder, worker.scratch().parent_path() / "in");
  const auto inputs = [&] {
    const std::filesystem::directory_iterator all(folder);
    return std::distance(begin(all), end(all));
  };
  EXPECT_EQ(inputs(), 1);
  worker.write("left behind", "by the first task");
  EXPECT_TRUE(worker.complete(*task, "voxels"));
  EXPECT_EQ(inputs(), 0);
  EXPECT_TRUE(std::filesystem::is_empty(worker.scratch()));
  const auto next = worker.claim();
  ASSERT_TRUE(next);
  EXPECT_EQ(read_file(next->input_path).value().size(), 12u);
  EXPECT_EQ(inputs(), 1);
  EXPECT_TRUE(worker.complete(*next, "other voxels"));
}

TEST_F(TaskServerTest, a_job_that_runs_too_long_fails_with_the_limit_and_is_not_tried_again) {
  limits_.job_seconds_max = 0.3;
  start();
  const std::string id = submit();
  FakeWorker worker = connect();
  const auto task = worker.claim();  // none where its time is over before the reply
  const JobStatus status = wait_end(id);
  ASSERT_EQ(status.state, JobState::kFailed);
  EXPECT_EQ(status.error->code, ErrorCode::kDeadlineExceeded);
  EXPECT_EQ(status.error->detail, "the job ran too long");
  EXPECT_EQ(status.attempt, 1);
  EXPECT_FALSE(task && worker.complete(*task, "too late"));
}

TEST_F(TaskServerTest, a_worker_that_takes_too_much_memory_ends_its_job_alone) {
  limits_.worker_memory_bytes_max = 1;  // the worker is this process
  start();
  const std::string id = submit();
  // A worker may be ended before it has a task, since idle ones count, too.
  std::optional<FakeWorker> worker;
  EXPECT_TRUE(testing::comes_true([&] {
    worker = FakeWorker::try_connect(socket(), "llvmpipe", testing::kPatience);
    return (worker && worker->claim()) || service_->get(Caller::open(), id).value().ended();
  }));
  const JobStatus status = wait_end(id);
  ASSERT_EQ(status.state, JobState::kFailed);
  EXPECT_EQ(status.error->code, ErrorCode::kGridTooLarge);
  EXPECT_TRUE(status.error->detail.starts_with("memory: ")) << status.error->detail;
}

TEST_F(TaskServerTest,
       a_job_is_retried_while_all_workers_take_too_much_and_then_fails_with_the_reason) {
  limits_.all_workers_memory_bytes_max = 1;
  start();
  const std::string id = submit();
  EXPECT_TRUE(testing::comes_true([&] {
    auto worker = FakeWorker::try_connect(socket(), "llvmpipe", testing::kPatience);
    // Without a task it was ended while it waited.
    if (const auto task = worker ? worker->claim() : std::nullopt) {
      EXPECT_TRUE(
          testing::comes_true([&] { return worker->progress(*task, "parse", 0, 0).fenced; }));
    }
    const JobStatus now = service_->get(Caller::open(), id).value();
    return now.ended() || now.attempt >= limits::kJobAttemptsMax;
  }));
  const JobStatus status = wait_end(id);
  ASSERT_EQ(status.state, JobState::kFailed);
  EXPECT_EQ(status.error->code, ErrorCode::kWorkerCrashed);
  EXPECT_TRUE(status.error->detail.starts_with("the job ended 3 workers: memory of all workers: "))
      << status.error->detail;
}

// The jobs of one state in the queue.
std::vector<ListedJob> queued_jobs(JobService& service, const Caller& caller, JobState state,
                                   std::optional<int64_t> after = std::nullopt) {
  std::vector<ListedJob> jobs;
  const JobQuery query{state, JobOrder::kOldestFirst, JobTexts::kBrief, after};
  EXPECT_TRUE(service.list(caller, query, [&](const ListedJob& job) {
    jobs.push_back(job);
    return true;
  }));
  return jobs;
}

TEST_F(TaskServerTest, the_queue_shows_devices_and_jobs_in_their_order) {
  const std::string first = submit("a"), second = submit("b"), third = submit("c");
  FakeWorker worker = connect("egl:0");
  ASSERT_TRUE(worker.claim());
  const QueueView view = service_->queue(Caller::open()).value();
  EXPECT_EQ(view.queued, 2);
  EXPECT_EQ(view.running, 1);
  EXPECT_EQ(view.others_queued, 0);
  const auto running = queued_jobs(*service_, Caller::open(), JobState::kRunning);
  ASSERT_EQ(running.size(), 1u);
  EXPECT_EQ(running[0].status.id, first);
  EXPECT_EQ(running[0].device, "egl:0");
  const auto waiting = queued_jobs(*service_, Caller::open(), JobState::kQueued);
  ASSERT_EQ(waiting.size(), 2u);
  EXPECT_EQ(waiting[0].status.id, second);
  EXPECT_EQ(waiting[0].status.queue_position, 1);
  const auto later = queued_jobs(*service_, Caller::open(), JobState::kQueued, waiting[0].seq);
  ASSERT_EQ(later.size(), 1u);
  EXPECT_EQ(later[0].status.id, third);
  EXPECT_EQ(later[0].status.queue_position, 2);
  ASSERT_EQ(view.devices.size(), 1u);
  EXPECT_EQ(view.devices[0].workers, 1);
  EXPECT_EQ(view.devices[0].workers_busy, 1);
  EXPECT_EQ(view.devices[0].jobs, std::vector{first});
  const QueueView other = service_->queue(Caller::tenant("lab", false)).value();
  EXPECT_EQ(other.others_queued, 2);
  EXPECT_EQ(other.others_running, 1);
  EXPECT_TRUE(queued_jobs(*service_, Caller::tenant("lab", false), JobState::kQueued).empty());
  EXPECT_TRUE(other.devices[0].jobs.empty());
  EXPECT_EQ(other.devices[0].workers_busy, 1);
}

TEST_F(TaskServerTest, a_worker_that_waits_gets_a_job_as_soon_as_it_is_submitted) {
  FakeWorker worker = connect();
  std::thread submitter([&] {
    std::this_thread::sleep_for(milliseconds(300));
    submit();
  });
  EXPECT_TRUE(worker.claim());
  submitter.join();
}

TEST_F(TaskServerTest, a_connection_that_ends_puts_its_task_back_at_once) {
  const std::string id = submit();
  {
    FakeWorker dying = connect();
    ASSERT_TRUE(dying.claim());
  }
  FakeWorker next = connect();
  const auto task = next.claim();
  ASSERT_TRUE(task);
  EXPECT_EQ(task->id, id);
  EXPECT_EQ(task->attempt, 2);
  EXPECT_EQ(task->fence, 2);
  EXPECT_TRUE(next.complete(*task, "second time"));
  EXPECT_EQ(wait_end(id).state, JobState::kDone);
}

// As after a claim that was committed and whose caller had no memory left.
TEST_F(TaskServerTest, a_running_job_that_no_worker_has_is_put_back_uncounted) {
  const std::string id = submit();
  auto claimed =
      SqliteConnection::open(dir_.path() / "data/jobs.sqlite", SqliteConnection::Role::kWriter);
  ASSERT_TRUE(claimed);
  ASSERT_TRUE(
      claimed->run("UPDATE jobs SET state = 'running', attempt = 1, fence = 1,"
                   " worker = 'llvmpipe' WHERE id = $1",
                   id));
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  EXPECT_EQ(task->id, id);
  EXPECT_EQ(task->attempt, 1);
  EXPECT_EQ(task->fence, 2);
  EXPECT_TRUE(worker.complete(*task, "voxels"));
  EXPECT_EQ(wait_end(id).state, JobState::kDone);
}

// Each claim begins with a look for running jobs that no worker has.
TEST_F(TaskServerTest, a_job_that_a_worker_has_is_not_put_back) {
  const std::string id = submit();
  FakeWorker working = connect(), next = connect();
  const auto task = working.claim();
  ASSERT_TRUE(task);
  JobRequest urgent;  // takes the last free worker though its tenant has another one
  urgent.asset = put_asset("mesh");
  urgent.options.use_cache = false;
  urgent.priority = 5;
  const std::string urgent_id = service_->submit(Caller::open(), urgent, {}).value().id;
  const auto other = next.claim();
  ASSERT_TRUE(other);
  EXPECT_EQ(other->id, urgent_id);
  EXPECT_EQ(service_->get(Caller::open(), id)->state, JobState::kRunning);
  EXPECT_TRUE(working.complete(*task, "voxels"));
  EXPECT_EQ(wait_end(id).state, JobState::kDone);
  EXPECT_EQ(service_->get(Caller::open(), id)->attempt, 1);
}

TEST_F(TaskServerTest, three_lost_workers_fail_the_job) {
  const std::string id = submit();
  for (int i = 0; i < 3; ++i) {
    FakeWorker dying = connect();
    ASSERT_TRUE(dying.claim());
  }
  const JobStatus status = wait_end(id);
  EXPECT_EQ(status.state, JobState::kFailed);
  EXPECT_EQ(status.error->code, ErrorCode::kWorkerCrashed);
  EXPECT_EQ(status.error->detail,
            "the job ended 3 workers: connection lost, connection lost, connection lost");
}

TEST_F(TaskServerTest, a_worker_that_died_while_it_waited_costs_no_attempt) {
  {
    auto fd = connect_unix(socket());
    ASSERT_TRUE(fd);
    FrameSocket dying(*std::move(fd), kTaskFrameBytesMax);
    WorkerHello hello;
    hello.pid = ::getpid();
    hello.device = "llvmpipe";
    hello.renderer = "r";
    hello.device_json = "{}";
    ASSERT_TRUE(dying.send(to_json_message(hello).dump()));
    ASSERT_TRUE(dying.receive());
    ASSERT_TRUE(dying.send(json{{"type", "claim"}}.dump()));
    std::this_thread::sleep_for(milliseconds(50));  // the gateway waits for a job on its behalf
  }
  const std::string id = submit();
  FakeWorker next = connect();
  EXPECT_EQ(next.claim()->attempt, 1);
  EXPECT_EQ(service_->get(Caller::open(), id).value().attempt, 1);
}

TEST_F(TaskServerTest, progress_reaches_status_events_and_waiting_clients) {
  const std::string id = submit();
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  const int64_t version = wait_for(id, JobState::kRunning).version;
  std::thread reporter([&] {
    std::this_thread::sleep_for(milliseconds(50));
    EXPECT_FALSE(worker.progress(*task, "voxelize", 2, 8).cancel);
  });
  const JobStatus status = testing::wait_change(*service_, Caller::open(), id, version,
                                                Clock::now() + testing::kPatience)
                               .value();
  reporter.join();
  EXPECT_EQ(status.version, version + 1);
  EXPECT_EQ(status.stage, "voxelize");
  EXPECT_EQ(status.tiles_done, 2);
  const auto events =
      testing::wait_events(*service_, Caller::open(), id, 0, Clock::now() + testing::kPatience)
          .value();
  ASSERT_EQ(events.size(), 3u);
  EXPECT_EQ(events[0].type, "state");
  EXPECT_EQ(events[2].type, "progress");
  EXPECT_EQ(events[2].id, version + 1);
  EXPECT_EQ(json::parse(events[2].data_json)["id"], id);
  ASSERT_TRUE(worker.complete(*task, "x"));
  const auto last = testing::wait_events(*service_, Caller::open(), id, events[2].id,
                                         Clock::now() + testing::kPatience)
                        .value();
  ASSERT_EQ(last.size(), 1u);
  EXPECT_EQ(last[0].type, "state");
  EXPECT_GT(last[0].id, events[2].id);
}

TEST_F(TaskServerTest, waiting_for_events_that_do_not_come_ends_at_the_deadline) {
  const std::string id = submit();
  EXPECT_TRUE(
      testing::wait_events(*service_, Caller::open(), id, 1, Clock::now() + milliseconds(50))
          .value()
          .empty());
}

TEST_F(TaskServerTest, a_cancel_reaches_the_worker_with_its_next_report) {
  const std::string id = submit();
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  EXPECT_FALSE(worker.progress(*task, "voxelize", 1, 8).cancel);
  EXPECT_EQ(service_->cancel(Caller::open(), id).value().state, JobState::kRunning);
  EXPECT_TRUE(worker.progress(*task, "voxelize", 2, 8).cancel);
  EXPECT_TRUE(worker.fail(*task, {ErrorCode::kCancelled, "the job was cancelled", "", ""}));
  EXPECT_EQ(wait_end(id).state, JobState::kCancelled);
  EXPECT_EQ(service_->cancel(Caller::open(), id).value().state, JobState::kCancelled);
}

TEST_F(TaskServerTest, a_worker_that_falls_silent_loses_its_task) {
  limits_.silence_seconds_max = 0.2;
  start();
  const std::string id = submit();
  FakeWorker silent = connect();
  ASSERT_TRUE(silent.claim());
  const JobStatus status = wait_for(id, JobState::kQueued);
  EXPECT_EQ(status.attempt, 1);
  FakeWorker next = connect();
  const auto task = next.claim();
  ASSERT_TRUE(task);
  EXPECT_EQ(task->attempt, 2);
}

TEST_F(TaskServerTest, reports_about_another_task_or_fence_are_fenced) {
  submit();
  FakeWorker worker = connect();
  auto task = worker.claim();
  ASSERT_TRUE(task);
  Task wrong = *task;
  wrong.fence = 7;
  EXPECT_TRUE(worker.progress(wrong, "voxelize", 1, 2).fenced);
  EXPECT_FALSE(worker.complete(wrong, "zombie"));
  EXPECT_FALSE(worker.fail(wrong, {ErrorCode::kInternal, "zombie", "", ""}));
  EXPECT_TRUE(worker.complete(*task, "good"));
}

TEST_F(TaskServerTest, an_output_outside_the_scratch_directory_fails_the_job) {
  for (const char* name : {"/etc/hostname", "%s/../secret", "%s/..", "relative"}) {
    const std::string id = submit();
    FakeWorker worker = connect();
    const auto task = worker.claim();
    ASSERT_TRUE(task);
    std::string path = name;
    if (const size_t at = path.find("%s"); at != std::string::npos) {
      path.replace(at, 2, worker.scratch().string());
    }
    TaskCompletion completion;
    completion.task = task->id;
    completion.fence = task->fence;
    completion.outputs = {{"result", path, "application/x-npy", "x"}};
    worker.complete_with(completion);
    const JobStatus status = wait_end(id);
    EXPECT_EQ(status.state, JobState::kFailed) << path;
    EXPECT_EQ(status.error->detail, "worker names an output outside its scratch directory");
  }
}

TEST_F(TaskServerTest, a_worker_of_another_protocol_is_turned_away) {
  auto fd = connect_unix(socket());
  ASSERT_TRUE(fd);
  FrameSocket raw(*std::move(fd), kTaskFrameBytesMax);
  WorkerHello hello;
  hello.protocol = 99;
  hello.pid = 1;
  hello.device = "llvmpipe";
  hello.renderer = "r";
  hello.device_json = "{}";
  ASSERT_TRUE(raw.send(to_json_message(hello).dump()));
  EXPECT_EQ(raw.receive().error().code, ErrorCode::kGone);
}

TEST_F(TaskServerTest, nonsense_on_the_socket_ends_that_connection_alone) {
  for (const char* text : {"", "{", "[]", "{\"type\":\"nothing\"}", "{\"type\":7}"}) {
    FakeWorker bad = connect();
    auto fd = connect_unix(socket());
    ASSERT_TRUE(fd);
    FrameSocket raw(*std::move(fd), kTaskFrameBytesMax);
    ASSERT_TRUE(raw.send(text));
    EXPECT_FALSE(raw.receive()) << text;
  }
  const std::string id = submit();
  FakeWorker good = connect();
  const auto task = good.claim();
  ASSERT_TRUE(task);
  EXPECT_TRUE(good.complete(*task, "fine"));
  EXPECT_EQ(wait_end(id).state, JobState::kDone);
}

TEST_F(TaskServerTest, connected_workers_and_their_tasks_are_shown) {
  EXPECT_EQ(service_->ready().error().code, ErrorCode::kDeviceUnavailable);
  const std::string id = submit();
  FakeWorker worker = connect("egl:0");
  ASSERT_TRUE(worker.claim());
  const auto workers = service_->workers();
  ASSERT_EQ(workers.size(), 1u);
  EXPECT_EQ(workers[0].device, "egl:0");
  EXPECT_EQ(workers[0].renderer, "fake renderer");
  EXPECT_EQ(workers[0].pid, ::getpid());
  EXPECT_TRUE(workers[0].connected);
  EXPECT_EQ(workers[0].task, id);
  EXPECT_TRUE(service_->ready()) << service_->ready().error().message();
  service_->drain();
  EXPECT_EQ(service_->ready().error().code, ErrorCode::kShuttingDown);
}

TEST_F(TaskServerTest, a_device_that_cannot_be_opened_is_named_in_ready) {
  auto fd = connect_unix(socket());
  ASSERT_TRUE(fd);
  FrameSocket raw(*std::move(fd), kTaskFrameBytesMax);
  WorkerHello hello;
  hello.pid = 1;
  hello.device = "egl:7";
  hello.device_json = "{}";
  ASSERT_TRUE(raw.send(to_json_message(hello).dump()));
  ASSERT_TRUE(raw.receive());
  const Error error{ErrorCode::kDeviceUnavailable, "egl:7: no such EGL device", "", ""};
  ASSERT_TRUE(raw.send(to_json_message(TaskFailure{"", 0, error}).dump()));
  ASSERT_TRUE(raw.receive());
  EXPECT_EQ(service_->ready().error().detail,
            "no worker is connected: egl:7: egl:7: no such EGL device");
  EXPECT_EQ(service_->workers()[0].last_error, "egl:7: no such EGL device");
}

TEST_F(TaskServerTest, a_device_that_failed_its_self_test_is_shown_from_the_start) {
  auto fd = connect_unix(socket());
  ASSERT_TRUE(fd);
  FrameSocket raw(*std::move(fd), kTaskFrameBytesMax);
  WorkerHello hello;
  hello.pid = 1;
  hello.device = "egl:0";
  hello.renderer = "a GPU";
  hello.device_failure = "self-test: raster: touch: 6 voxels, 7 on the CPU";
  ASSERT_TRUE(raw.send(to_json_message(hello).dump()));
  ASSERT_TRUE(raw.receive());
  ASSERT_EQ(service_->workers().size(), 1U);
  EXPECT_EQ(service_->workers()[0].device_failure, hello.device_failure);
}

TEST_F(TaskServerTest, a_device_that_fails_is_shown_until_it_works_again) {
  FakeWorker worker = connect("egl:0");
  EXPECT_EQ(service_->workers().at(0).device_failure, "");
  const std::string id = submit();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  for (const std::string failure : {"out of device memory", ""}) {
    const Error error{ErrorCode::kDeviceUnavailable, failure, "", ""};
    const auto reply = worker.call(to_json_message(TaskFailure{"", 0, error}));
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->at("ok"), true);
    EXPECT_EQ(service_->workers().at(0).device_failure, failure);
    EXPECT_TRUE(service_->ready());
  }
  EXPECT_TRUE(worker.complete(*task, "fine"));
  EXPECT_EQ(wait_end(id).state, JobState::kDone);
}

TEST_F(TaskServerTest, a_draining_service_takes_no_new_jobs) {
  JobRequest request;
  request.asset = put_asset("mesh");
  service_->drain();
  EXPECT_EQ(service_->submit(Caller::open(), request, {}).error().code, ErrorCode::kShuttingDown);
}

TEST_F(TaskServerTest, a_stopping_service_puts_running_tasks_back_uncounted) {
  const std::string id = submit();
  FakeWorker worker = connect();
  ASSERT_TRUE(worker.claim());
  start();
  const JobStatus status = service_->get(Caller::open(), id).value();
  EXPECT_EQ(status.state, JobState::kQueued);
  EXPECT_EQ(status.attempt, 0);
}

}  // namespace
}  // namespace voxeld
