// Frames: listed while their job runs, kept when it ends badly, one sequence when it ends well.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "server/base/sha256.h"
#include "tests/unit/jobs/service_fixture.h"

namespace voxeld {
namespace {

using nlohmann::json;
using testing::fake_frame;
using testing::FakeWorker;

class FramesTest : public testing::ServiceTest {
 protected:
  // A job and its task at a worker.
  Task claim(FakeWorker& worker, const JobRequest& request) {
    id_ = submit(request).id;
    const auto task = worker.claim();
    EXPECT_TRUE(task && task->id == id_);
    return task.value_or(Task{});
  }
  std::vector<std::string> grids(const std::string& job) {
    std::vector<std::string> ids;
    const auto frames = service_->frames(Caller::open(), job, {});
    EXPECT_TRUE(frames) << frames.error().message();
    for (const ListedFrame& listed : frames->frames) ids.push_back(listed.frame.grid);
    return ids;
  }
  // A sequence of three frames, the first and last of them equal.
  JobStatus finished() {
    FakeWorker worker = connect();
    const Task task = claim(worker, moving());
    for (const char* text : {"a", "b", "a"}) worker.frame(task, next_++, text);
    next_ = 0;
    EXPECT_EQ(worker.complete_sequence(task, {"a", "b", "a"}, "all").value("ok", false), true);
    return wait_end(id_);
  }
  std::string id_;
  int64_t next_ = 0;
};

TEST_F(FramesTest, a_frame_is_listed_and_can_be_fetched_while_its_job_runs) {
  FakeWorker worker = connect();
  const Task task = claim(worker, moving());
  worker.call(to_json_message(TaskProgress{task.id, task.fence, "voxelize", 0, 8, 0, 3, {}}));
  const TaskFrameReply reply = worker.frame(task, 0, "first");
  EXPECT_FALSE(reply.fenced || reply.cancel);
  EXPECT_EQ(reply.grid, sha256_id("first"));
  EXPECT_TRUE(std::filesystem::exists(reply.path));
  EXPECT_FALSE(std::filesystem::exists(worker.scratch() / "frame.voxg"));
  worker.frame(task, 1, "second");
  const auto frames = service_->frames(Caller::open(), id_, {});
  ASSERT_TRUE(frames) << frames.error().message();
  EXPECT_EQ(frames->job, id_);
  EXPECT_EQ(frames->sequence, "");
  EXPECT_EQ(frames->frames_total, 3);
  ASSERT_EQ(frames->frames.size(), 2u);
  const SequenceFrame second = fake_frame(1, "second");
  EXPECT_EQ(frames->frames[1].index, 1);
  EXPECT_EQ(frames->frames[1].frame.time_s, second.time_s);
  EXPECT_EQ(frames->frames[1].frame.grid, second.grid);
  EXPECT_EQ(frames->frames[1].frame.voxel_count, second.voxel_count);
  EXPECT_EQ(frames->frames[1].frame.content_hash, second.content_hash);
  EXPECT_EQ(service_->get_grid(Caller::open(), second.grid).value().bytes, 6);
  const JobStatus status = service_->get(Caller::open(), id_).value();
  EXPECT_EQ(status.state, JobState::kRunning);
  EXPECT_EQ(status.frames_done, 2);
  EXPECT_EQ(status.frames_total, 3);
}

TEST_F(FramesTest, events_count_frames) {
  FakeWorker worker = connect();
  const Task task = claim(worker, moving());
  worker.call(to_json_message(TaskProgress{task.id, task.fence, "voxelize", 1, 8, 2, 9, {}}));
  const auto events =
      testing::wait_events(*service_, Caller::open(), id_, 0, Clock::now() + testing::kPatience)
          .value();
  ASSERT_FALSE(events.empty());
  EXPECT_EQ(events.back().type, "progress");
  const json data = json::parse(events.back().data_json);
  EXPECT_EQ(data["frames_done"], 2);
  EXPECT_EQ(data["frames_total"], 9);
}

TEST_F(FramesTest, a_cancel_reaches_the_worker_with_its_next_frame_and_keeps_what_is_done) {
  FakeWorker worker = connect();
  const Task task = claim(worker, moving());
  EXPECT_FALSE(worker.frame(task, 0, "first", 9).cancel);
  ASSERT_TRUE(service_->cancel(Caller::open(), id_));
  const TaskFrameReply reply = worker.frame(task, 1, "second", 9);
  EXPECT_TRUE(reply.cancel);
  EXPECT_FALSE(reply.fenced);
  ASSERT_TRUE(worker.fail(task, {ErrorCode::kCancelled, "the job was cancelled", "", ""}));
  EXPECT_EQ(wait_end(id_).state, JobState::kCancelled);
  EXPECT_EQ(grids(id_), (std::vector{sha256_id("first"), sha256_id("second")}));
  EXPECT_TRUE(service_->get_grid(Caller::open(), sha256_id("second")));
  EXPECT_EQ(service_->get(Caller::open(), id_).value().frames_done, 2);
  // Told by the frames alone: no progress came before the cancel.
  EXPECT_EQ(service_->frames(Caller::open(), id_, {}).value().frames_total, 9);
}

TEST_F(FramesTest, a_failure_keeps_what_is_done) {
  FakeWorker worker = connect();
  const Task task = claim(worker, moving());
  worker.frame(task, 0, "first");
  ASSERT_TRUE(worker.fail(task, {ErrorCode::kMalformedMesh, "bob.md5anim line 7", "", ""}));
  EXPECT_EQ(wait_end(id_).state, JobState::kFailed);
  EXPECT_EQ(grids(id_), std::vector{sha256_id("first")});
}

TEST_F(FramesTest, a_restart_keeps_frames_and_the_next_attempt_lists_them_again) {
  {
    FakeWorker worker = connect();
    const Task task = claim(worker, moving());
    worker.frame(task, 0, "first");
    worker.frame(task, 2, "third");
    start();
  }
  EXPECT_EQ(service_->get(Caller::open(), id_).value().state, JobState::kQueued);
  EXPECT_EQ(grids(id_), (std::vector{sha256_id("first"), sha256_id("third")}));
  EXPECT_TRUE(service_->get_grid(Caller::open(), sha256_id("third")));
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  worker.frame(*task, 0, "first");
  worker.frame(*task, 1, "second");
  worker.frame(*task, 2, "another third");
  EXPECT_EQ(grids(id_),
            (std::vector{sha256_id("first"), sha256_id("second"), sha256_id("another third")}));
}

TEST_F(FramesTest, frames_of_another_task_or_fence_are_dropped) {
  FakeWorker worker = connect();
  const Task task = claim(worker, moving());
  Task wrong = task;
  wrong.fence = 7;
  EXPECT_TRUE(worker.frame(wrong, 0, "zombie").fenced);
  wrong = task;
  wrong.id = "j-other";
  EXPECT_TRUE(worker.frame(wrong, 0, "zombie").fenced);
  EXPECT_TRUE(grids(id_).empty());
  EXPECT_FALSE(service_->get_grid(Caller::open(), sha256_id("zombie")));
  EXPECT_FALSE(worker.frame(task, 0, "good").fenced);
}

TEST_F(FramesTest, a_frame_outside_the_scratch_directory_fails_the_job) {
  FakeWorker worker = connect();
  const Task task = claim(worker, moving());
  const auto reply = worker.call(
      to_json_message(TaskFrame{task.id, task.fence, 0, 0, "/etc/hostname", 1, sha256_id("x")}));
  ASSERT_TRUE(reply);
  EXPECT_EQ((*reply)["fenced"], true);
  const JobStatus status = wait_end(id_);
  EXPECT_EQ(status.state, JobState::kFailed);
  EXPECT_EQ(status.error->detail, "worker names an output outside its scratch directory");
  // The connection goes on with the next task.
  EXPECT_EQ(claim(worker, moving("another")).attempt, 1);
}

TEST_F(FramesTest, a_frame_that_is_replaced_goes) {
  submit(moving());
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  worker.frame(*task, 0, "first");
  worker.frame(*task, 0, "another");
  EXPECT_TRUE(is_removed(sha256_id("first")));
  EXPECT_TRUE(blobs().stat(sha256_id("another")));
}

TEST_F(FramesTest, a_finished_job_is_a_sequence) {
  const JobStatus status = finished();
  EXPECT_EQ(status.state, JobState::kDone);
  EXPECT_EQ(status.frames_done, 3);
  EXPECT_EQ(status.frames_total, 3);
  ASSERT_TRUE(status.result);
  EXPECT_EQ(status.result->filename, "bob.voxs");
  EXPECT_NE(status.result->sequence, "");
  const auto manifest = service_->get_sequence(Caller::open(), status.result->sequence);
  ASSERT_TRUE(manifest) << manifest.error().message();
  ASSERT_EQ(manifest->frames.size(), 3u);
  EXPECT_EQ(manifest->frames[0].grid, manifest->frames[2].grid);
  EXPECT_EQ(service_->frames(Caller::open(), status.id, {}).value().sequence,
            status.result->sequence);
  EXPECT_EQ(service_->get_sequence(Caller::open(), "sha256-1").error().message(),
            "no such sequence: expected the id of a sequence, got sha256-1");
  // A blob that is no sequence is none.
  EXPECT_EQ(service_->get_sequence(Caller::open(), sha256_id("a")).error().code,
            ErrorCode::kNotFound);
}

TEST_F(FramesTest, an_equal_request_is_answered_with_the_sequence_and_its_frames) {
  const JobStatus first = finished();
  const JobStatus again = submit(moving());
  EXPECT_TRUE(again.cached);
  EXPECT_EQ(again.result->sequence, first.result->sequence);
  EXPECT_EQ(again.frames_done, 3);
  EXPECT_EQ(again.frames_total, 3);
  EXPECT_EQ(grids(again.id), grids(first.id));
  EXPECT_EQ(grids(again.id), (std::vector{sha256_id("a"), sha256_id("b"), sha256_id("a")}));
}

TEST_F(FramesTest, a_sequence_of_which_a_frame_is_lost_is_made_again) {
  finished();
  ASSERT_TRUE(blobs().remove(sha256_id("b")));
  const JobStatus again = submit(moving());
  EXPECT_FALSE(again.cached);
  EXPECT_EQ(again.state, JobState::kQueued);
}

TEST_F(FramesTest, a_manifest_that_names_other_frames_than_were_reported_fails_the_job) {
  for (const auto& [named, message] : {
           std::pair{std::vector<std::string>{"a"}, "number of frames: expected 2, got 1"},
           {std::vector<std::string>{"b", "a"}, "grid of frame 0: expected "},
       }) {
    FakeWorker worker = connect();
    JobRequest request = moving();
    request.options.use_cache = false;
    const Task task = claim(worker, request);
    worker.frame(task, 0, "a");
    worker.frame(task, 1, "b");
    worker.complete_sequence(task, named, "all");
    const JobStatus status = wait_end(id_);
    EXPECT_EQ(status.state, JobState::kFailed);
    EXPECT_EQ(status.error->code, ErrorCode::kInternal);
    EXPECT_TRUE(
        status.error->message().starts_with("worker brings a sequence: " + std::string(message)))
        << status.error->message();
  }
}

TEST_F(FramesTest, a_task_on_a_sequence_names_its_manifest_and_its_frames) {
  const std::string sequence = finished().result->sequence;
  for (const JobKind kind : {JobKind::kExport, JobKind::kRender}) {
    JobRequest request;
    request.kind = kind;
    request.sequence = sequence;
    FakeWorker worker = connect();
    const Task task = claim(worker, request);
    EXPECT_TRUE(task.input_is_sequence);
    EXPECT_FALSE(task.input_is_grid);
    EXPECT_EQ(task.input_hash, sequence);
    EXPECT_EQ(task.input_path, worker.input(sequence));
    EXPECT_TRUE(std::filesystem::equivalent(task.input_path, blobs().path_of(sequence)));
    const std::string a = worker.input(sha256_id("a"));
    EXPECT_EQ(task.frame_paths, (std::vector<std::string>{a, worker.input(sha256_id("b")), a}));
    EXPECT_TRUE(std::filesystem::equivalent(a, blobs().path_of(sha256_id("a"))));
    EXPECT_EQ(service_->get(Caller::open(), id_).value().sequence, sequence);
    ASSERT_TRUE(worker.complete(task, "exported"));
  }
}

TEST_F(FramesTest, a_task_whose_manifest_cannot_be_read_fails_and_the_worker_goes_on) {
  const std::string sequence = finished().result->sequence;
  JobRequest request;
  request.kind = JobKind::kExport;
  request.sequence = sequence;
  const std::string broken = submit(request).id;
  ASSERT_TRUE(blobs().remove(sequence));
  const std::string next = submit(moving("another")).id;
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  EXPECT_EQ(task->id, next);
  const JobStatus status = wait_end(broken);
  EXPECT_EQ(status.state, JobState::kFailed);
  EXPECT_EQ(status.error->code, ErrorCode::kGone);
  EXPECT_EQ(status.error->detail,
            "the sequence " + sequence +
                " is not stored any more: it expired or made room for others; submit the job that "
                "made it again");
}

TEST_F(FramesTest, a_request_on_a_sequence_is_checked) {
  const std::string sequence = finished().result->sequence;
  JobRequest request;
  request.kind = JobKind::kRender;
  request.sequence = sha256_id("nothing");
  EXPECT_EQ(service_->submit(Caller::open(), request, {}).error().detail, "no such sequence");
  request.sequence = sequence;
  request.options.render.image = ImageKind::kGif;
  request.options.render.turntable = 9;
  EXPECT_EQ(service_->submit(Caller::open(), request, {}).error().message(),
            "turntable: expected a grid as input, got a sequence");
  request.options.render.turntable = 0;
  EXPECT_TRUE(service_->submit(Caller::open(), request, {}));
  request.sequence.clear();
  request.grid = sha256_id("a");
  EXPECT_EQ(service_->submit(Caller::open(), request, {}).error().code, ErrorCode::kInvalidOption);
}

TEST_F(FramesTest, a_sequence_and_a_frame_that_jobs_work_on_are_used) {
  const std::string sequence = finished().result->sequence;
  const auto used_ms = [this] {
    service_.reset();
    auto reader =
        SqliteConnection::open(dir_.path() / "data/jobs.sqlite", SqliteConnection::Role::kReader);
    auto row = reader->query("SELECT used_ms FROM results");
    EXPECT_TRUE(row && row->step());
    return row->int64(0);
  };
  for (const bool is_frame : {false, true}) {
    (void)used_ms();
    {
      auto writer =
          SqliteConnection::open(dir_.path() / "data/jobs.sqlite", SqliteConnection::Role::kWriter);
      ASSERT_TRUE(writer && writer->run("UPDATE results SET used_ms = 1"));
    }
    start();
    JobRequest request;
    request.kind = JobKind::kExport;
    (is_frame ? request.grid : request.sequence) = is_frame ? sha256_id("a") : sequence;
    submit(request);
    EXPECT_GT(used_ms(), 1);
  }
}

TEST_F(FramesTest, an_estimate_counts_the_frames_of_a_sequence) {
  JobRequest one, all;
  all.sequence = finished().result->sequence;
  one.grid = sha256_id("a");
  one.kind = all.kind = JobKind::kRender;
  all.options.render.image = ImageKind::kGif;
  const auto image = service_->estimate(Caller::open(), one);
  const auto series = service_->estimate(Caller::open(), all);
  ASSERT_TRUE(image && image->estimate && series && series->estimate);
  const double seconds = series->estimate->seconds;
  EXPECT_NEAR(seconds, 3 * image->estimate->seconds, seconds / 100);
}

TEST_F(FramesTest, an_upload_that_is_also_a_frame_or_manifest_stays_when_the_asset_is_deleted) {
  const JobStatus status = finished();
  const auto manifest = blobs().path_of(status.result->sequence);
  ASSERT_TRUE(service_->put_asset(Caller::open(), blobs().stat(sha256_id("a")).value(), "a", ""));
  ASSERT_TRUE(
      service_->put_asset(Caller::open(), blobs().stat(status.result->sequence).value(), "m", ""));
  ASSERT_TRUE(service_->delete_asset(Caller::open(), sha256_id("a")));
  ASSERT_TRUE(service_->delete_asset(Caller::open(), status.result->sequence));
  EXPECT_TRUE(service_->get_grid(Caller::open(), sha256_id("a")));
  EXPECT_TRUE(std::filesystem::exists(manifest));
}

}  // namespace
}  // namespace voxeld
