// Time slices over the socket, as workers ask for them.
#include "server/jobs/workers/slice_server.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "server/jobs/database/sqlite_database.h"
#include "server/jobs/workers/worker_session.h"
#include "tests/unit/jobs/service_fixture.h"

namespace voxeld {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using testing::FakeWorker;

// A worker's second connection.
class FakeSlices {
 public:
  explicit FakeSlices(const std::filesystem::path& socket)
      : socket_(connect_unix(socket).value(), kTaskFrameBytesMax) {
    EXPECT_TRUE(socket_.set_receive_timeout(static_cast<double>(testing::kPatience.count())));
    EXPECT_TRUE(socket_.send(to_json_message(SlicesHello{1, ::getpid(), "llvmpipe"}).dump()));
    EXPECT_TRUE(socket_.receive());
  }
  SliceReply ask(const Task& task, SliceAction action = SliceAction::kTake,
                 int64_t host_bytes = 0) {
    const SliceRequest request{action, task.id, task.fence, host_bytes};
    EXPECT_TRUE(socket_.send(to_json_message(request).dump()));
    return parse_slice_reply(json::parse(socket_.receive().value())).value();
  }
  void give(const Task& task) {
    EXPECT_TRUE(socket_.send(
        to_json_message(SliceRequest{SliceAction::kGive, task.id, task.fence}).dump()));
  }
  void close() { socket_.shutdown(); }
  FrameSocket& socket() { return socket_; }

 private:
  FrameSocket socket_;
};

class SliceServerTest : public testing::ServiceTest {
 protected:
  // None of these workers reports, however long a test takes.
  SliceServerTest() { task_limits_.slice_silence_seconds_max = 3600; }
  FakeSlices connect_slices() { return FakeSlices(dir_.path() / "data/run/tasks.sock"); }
  std::string submit_as(const std::string& tenant, const std::string& mesh = "mesh") {
    const Caller caller = Caller::tenant(tenant, false);
    JobRequest request;
    request.asset = service_->put_asset(caller, put_blob(mesh), "a.ply", "").value().id;
    return service_->submit(caller, request, {}).value().id;
  }
  JobStatus get(const std::string& id) { return service_->get(Caller::daemon(), id).value(); }
  void wait_until_waiting(const Task& task) {
    EXPECT_TRUE(testing::comes_true([&] { return !get(task.id).waiting_for.empty(); }));
  }
  void SetUp() override {
    ServiceTest::SetUp();
    submit_as("a");
    submit_as("b");
    one_.emplace(connect());
    first_heard_ = Clock::now();
    first_ = one_->claim().value();
    two_.emplace(connect());
    second_ = two_->claim().value();
  }
  std::optional<FakeWorker> one_, two_;
  Clock::time_point first_heard_;  // before which one_ was not silent
  Task first_, second_;
};

TEST_F(SliceServerTest, one_task_has_the_device_and_the_other_waits_and_says_so) {
  FakeSlices one = connect_slices(), two = connect_slices();
  EXPECT_TRUE(one.ask(first_).granted);
  std::thread waiter([&] { EXPECT_TRUE(two.ask(second_).granted); });
  wait_until_waiting(second_);
  EXPECT_EQ(get(second_.id).waiting_for, "a time slice on llvmpipe: 1 tenant before");
  std::this_thread::sleep_for(milliseconds(30));
  one.give(first_);
  waiter.join();
  EXPECT_GE(get(first_.id).device_ms, 30.0);
  EXPECT_TRUE(one_->complete(first_, "x"));
  EXPECT_GE(get(first_.id).device_ms, 30.0);                   // it is stored with the job
  EXPECT_TRUE(two.ask(second_, SliceAction::kRenew).granted);  // nobody else asks
}

TEST_F(SliceServerTest, a_connection_that_ends_releases_its_slice) {
  FakeSlices one = connect_slices(), two = connect_slices();
  EXPECT_TRUE(one.ask(first_).granted);
  std::thread waiter([&] { EXPECT_TRUE(two.ask(second_).granted); });
  wait_until_waiting(second_);
  one.close();
  waiter.join();
}

TEST_F(SliceServerTest, a_lost_worker_releases_its_slice) {
  FakeSlices one = connect_slices(), two = connect_slices();
  EXPECT_TRUE(one.ask(first_).granted);
  std::thread waiter([&] { EXPECT_TRUE(two.ask(second_).granted); });
  wait_until_waiting(second_);
  one_.reset();  // its first connection; the second one is still there
  waiter.join();
  EXPECT_TRUE(one.ask(first_, SliceAction::kRenew).fenced);
}

TEST_F(SliceServerTest, a_worker_that_a_job_ends_is_charged_to_its_tenant) {
  const std::string third = submit_as("b", "other mesh");
  one_.reset();
  EXPECT_TRUE(testing::comes_true([&] { return get(first_.id).state == JobState::kQueued; }));
  EXPECT_TRUE(two_->complete(second_, "x"));
  const auto next = two_->claim();
  ASSERT_TRUE(next);
  EXPECT_EQ(next->id, third) << "the job that was lost came first";
  EXPECT_TRUE(two_->complete(*next, "y"));
}

class SliceMemoryTest : public SliceServerTest {
 protected:
  SliceMemoryTest() { memory_bytes_max_ = 8'000'000'000; }
  // The second worker leaves its job, as if others had taken it so much memory.
  void displace(const Task& task, int64_t bytes) {
    two_.reset();
    EXPECT_TRUE(testing::comes_true([&] { return get(task.id).state == JobState::kQueued; }));
    auto rows =
        SqliteConnection::open(dir_.path() / "data/jobs.sqlite", SqliteConnection::Role::kWriter);
    ASSERT_TRUE(rows);
    ASSERT_TRUE(rows->run("UPDATE jobs SET displaced_bytes = $2 WHERE id = $1", task.id, bytes));
  }
};

TEST_F(SliceMemoryTest, a_displaced_job_starts_again_once_what_it_took_fits_beside_the_others) {
  FakeSlices one = connect_slices();
  EXPECT_TRUE(one.ask(first_, SliceAction::kTake, 5'000'000'000).granted);
  displace(second_, 4'000'000'000);
  FakeWorker next = connect();
  std::optional<Task> again;
  std::thread claim([&] { again = next.claim(); });
  wait_until_waiting(second_);
  EXPECT_TRUE(testing::comes_true(
      [&] { return get(second_.id).waiting_for == "memory: needs 4.0 GB, 3.0 of 8.0 GB free"; }));
  EXPECT_TRUE(one_->complete(first_, "x"));
  claim.join();
  ASSERT_TRUE(again);
  EXPECT_EQ(again->id, second_.id);
  EXPECT_TRUE(next.complete(*again, "y"));
}

// Neither worker reports: one has its slice, the other one has not even got its task.
TEST_F(SliceMemoryTest, a_tenant_is_not_left_out_while_workers_wait_for_memory) {
  FakeSlices one = connect_slices();
  EXPECT_TRUE(one.ask(first_, SliceAction::kTake, 5'000'000'000).granted);
  displace(second_, 4'000'000'000);
  FakeWorker next = connect();
  std::thread claim([&] { next.claim(); });
  wait_until_waiting(second_);
  submit_as("c", "third mesh");
  std::string log;
  EXPECT_TRUE(testing::comes_true([&] {
    ::testing::internal::CaptureStderr();
    std::this_thread::sleep_for(milliseconds(100));
    log += ::testing::internal::GetCapturedStderr();
    return log.find("extra=1") != std::string::npos;
  })) << log;
  EXPECT_TRUE(one_->complete(first_, "x"));
  claim.join();
}

constexpr milliseconds kShortSilence{500};

class SliceSilenceTest : public SliceServerTest {
 protected:
  SliceSilenceTest() {
    task_limits_.slice_silence_seconds_max = std::chrono::duration<double>(kShortSilence).count();
  }
};

// A worker that is stopped, or hangs with all of its threads: the kernel keeps its connections.
TEST_F(SliceSilenceTest, a_silent_worker_loses_its_slice_and_not_its_task) {
  FakeSlices one = connect_slices(), two = connect_slices();
  EXPECT_TRUE(one.ask(first_).granted);
  std::atomic<bool> is_over{false};
  std::thread reports([&] {
    while (!is_over) {
      two_->progress(second_, "parse", 0, 0);
      std::this_thread::sleep_for(milliseconds(20));
    }
  });
  EXPECT_TRUE(two.ask(second_).granted);
  two.give(second_);
  is_over = true;
  reports.join();
  EXPECT_TRUE(one.ask(first_, SliceAction::kRenew).granted);  // it goes on
  EXPECT_TRUE(one_->complete(first_, "x"));
}

// The control is the longest time without a report: a machine that pauses the test makes the worker
// silent.
TEST_F(SliceSilenceTest, a_worker_that_reports_holds_its_slice) {
  FakeSlices one = connect_slices(), two = connect_slices();
  auto reported = first_heard_;
  Clock::duration longest{};
  const auto report = [&] {
    const auto since = std::exchange(reported, Clock::now());
    one_->progress(first_, "voxelize", 1, 8);
    longest = std::max(longest, Clock::now() - since);
  };
  report();
  EXPECT_TRUE(one.ask(first_).granted);
  std::atomic<bool> is_granted{false};
  std::thread waiter([&] { is_granted = two.ask(second_).granted; });
  EXPECT_TRUE(
      testing::comes_true([&] { return is_granted || !get(second_.id).waiting_for.empty(); }));
  for (const auto end = Clock::now() + 3 * kShortSilence; Clock::now() < end;) {
    report();
    std::this_thread::sleep_for(milliseconds(20));
  }
  const bool was_granted = is_granted;
  report();
  if (longest < kShortSilence) {
    EXPECT_FALSE(was_granted);
  }
  one.give(first_);
  waiter.join();
  EXPECT_TRUE(is_granted);
}

TEST_F(SliceServerTest, needs_beyond_any_machine_end_the_connection) {
  FakeSlices slices = connect_slices();
  SliceRequest request{SliceAction::kTake, first_.id, first_.fence, INT64_MAX, 0};
  ASSERT_TRUE(slices.socket().send(to_json_message(request).dump()));
  EXPECT_FALSE(slices.socket().receive());
}

TEST_F(SliceServerTest, a_cancel_stops_a_task_that_waits_for_its_slice) {
  FakeSlices one = connect_slices(), two = connect_slices();
  EXPECT_TRUE(one.ask(first_).granted);
  std::thread waiter([&] {
    const SliceReply reply = two.ask(second_);
    EXPECT_TRUE(reply.cancel);
    EXPECT_FALSE(reply.granted);
  });
  wait_until_waiting(second_);
  ASSERT_TRUE(service_->cancel(Caller::daemon(), second_.id));
  waiter.join();
  ASSERT_TRUE(service_->cancel(Caller::daemon(), first_.id));
  EXPECT_TRUE(one.ask(first_, SliceAction::kRenew).cancel);
}

TEST_F(SliceServerTest, a_worker_that_dies_while_it_waits_leaves_the_queue) {
  FakeSlices one = connect_slices(), two = connect_slices();
  EXPECT_TRUE(one.ask(first_).granted);
  const std::string ask = to_json_message(SliceRequest{SliceAction::kTake, second_.id, 1}).dump();
  ASSERT_TRUE(two.socket().send(ask));
  wait_until_waiting(second_);
  two.close();
  EXPECT_TRUE(testing::comes_true([&] { return get(second_.id).waiting_for.empty(); }));
}

TEST_F(SliceServerTest, another_fence_or_task_gets_no_slice) {
  FakeSlices slices = connect_slices();
  Task wrong = first_;
  wrong.fence = 7;
  EXPECT_TRUE(slices.ask(wrong).fenced);
  wrong.id = "j-none";
  EXPECT_TRUE(slices.ask(wrong).fenced);
  EXPECT_TRUE(slices.ask(first_).granted);
}

TEST_F(SliceServerTest, an_invalid_message_ends_that_connection_and_its_slice) {
  for (const char* text : {"{", "[]", R"({"type":"slice_take"})",
                           R"({"type":"slice_take","task":"x","fence":1,"host_bytes":-1})"}) {
    FakeSlices bad = connect_slices();
    EXPECT_TRUE(bad.ask(first_).granted);
    ASSERT_TRUE(bad.socket().send(text));
    EXPECT_FALSE(bad.socket().receive()) << text;
  }
  FakeSlices good = connect_slices();
  EXPECT_TRUE(good.ask(second_).granted);
}

// A session whose gateway stops when the test says so, with its connection still open: slices say
// so on theirs before it is closed.
TEST(StoppingGateway, a_task_that_the_end_of_its_slices_stops_is_put_back) {
  testing::TemporaryDir dir;
  BlobStore blobs = BlobStore::open(dir.path()).value();
  const auto database = SqliteDatabase::open(dir.path() / "jobs.sqlite").value();
  JobStore jobs(
      *database, [](std::string_view) { return true; }, [] { return unix_time_ms(); });
  AssetStore assets(*database, blobs);
  FrameStore frames(*database, blobs);
  PartStore parts = PartStore::open(dir.path()).value();
  JobBoard board;
  JobMetrics metrics(nullptr);
  TimeSlices slices{TimeSlicesConfig{}};
  const TaskServerConfig config{};
  const TaskServerContext context{jobs,  assets, frames,  blobs,  blobs.disk(),
                                  parts, board,  metrics, slices, [](const JobRecord&) {}};
  Dispatcher dispatcher(config, context);
  OutputAdopter outputs(config, context);
  std::atomic<bool> is_stopping{false};
  const UniqueFd listener = listen_unix(dir.path() / "tasks.sock").value();
  std::thread gateway([&] {
    UniqueFd connection(::accept4(listener.get(), nullptr, nullptr, SOCK_CLOEXEC));
    WorkerSession session(1, std::move(connection), dir.path() / "w1",
                          {config, context, dispatcher, outputs, is_stopping,
                           [](const WorkerState&) {}, [](const std::string&) {}});
    session.run();
  });
  auto writer = blobs.begin(100);
  const std::vector<uint8_t> bytes = {1, 2, 3};
  EXPECT_TRUE(writer && writer->append(bytes));
  JobRequest request;
  request.asset = assets.put(Caller::open(), writer->finish().value(), "a.ply", "", 0).value().id;
  const auto submitted = jobs.submit(Caller::open(), request, {}, {100, 0});
  EXPECT_TRUE(submitted);
  FakeWorker worker(dir.path() / "tasks.sock", "llvmpipe", testing::kPatience);
  const Task task = worker.claim().value();
  is_stopping = true;
  EXPECT_FALSE(worker.fail(task, {ErrorCode::kCancelled, "the job was cancelled", "", ""}));
  gateway.join();
  const JobStatus status = jobs.get(Caller::daemon(), task.id).value().status;
  EXPECT_EQ(status.state, JobState::kQueued);
  EXPECT_EQ(status.attempt, 0) << "it does not count";
}

}  // namespace
}  // namespace voxeld
