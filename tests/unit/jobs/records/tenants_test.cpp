// Data of one tenant does not exist for another, and no response to the other reveals it.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "server/base/sha256.h"
#include "tests/unit/jobs/lists.h"
#include "tests/unit/jobs/service_fixture.h"

namespace voxeld {
namespace {

using std::chrono::milliseconds;
using testing::FakeWorker;

class TenantsTest : public testing::ServiceTest {
 protected:
  Asset put(const Caller& caller, const std::string& text, const std::string& name = "a.ply") {
    auto asset = service_->put_asset(caller, put_blob(text), name, "");
    EXPECT_TRUE(asset) << asset.error().message();
    return *std::move(asset);
  }
  static JobRequest request(const std::string& asset) {
    JobRequest request;
    request.asset = asset;
    return request;
  }
  JobStatus submit_for(const Caller& caller, const JobRequest& request,
                       const SubmitOptions& options = {}) {
    auto status = service_->submit(caller, request, options);
    EXPECT_TRUE(status) << status.error().message();
    return *std::move(status);
  }
  // A finished job of the caller.
  JobStatus finish(const Caller& caller, const JobRequest& request, const std::string& result) {
    const std::string id = submit_for(caller, request).id;
    FakeWorker worker = connect();
    const auto task = worker.claim();
    EXPECT_TRUE(task && task->id == id);
    EXPECT_TRUE(task && worker.complete(*task, result));
    return testing::wait_end(*service_, caller, id).value();
  }
  // A sequence of two frames.
  JobStatus finish_sequence(const Caller& caller) {
    JobRequest moving = request(put(caller, "mesh").id);
    moving.options.animation.animation = "0";
    const std::string id = submit_for(caller, moving).id;
    FakeWorker worker = connect();
    const auto task = worker.claim();
    EXPECT_TRUE(task);
    worker.frame(*task, 0, "first");
    worker.frame(*task, 1, "second");
    worker.complete_sequence(*task, {"first", "second"}, "all");
    return testing::wait_end(*service_, caller, id).value();
  }
  static std::string message(const Error& error) { return error.message(); }

  const Caller lab_ = Caller::tenant("lab", false);
  const Caller studio_ = Caller::tenant("studio", false);
  const Caller boss_ = Caller::tenant("boss", true);
};

TEST_F(TenantsTest, an_asset_of_another_is_as_one_that_never_was) {
  const std::string id = put(lab_, "mesh").id, nothing = sha256_id("nothing");
  const auto text = [&](const std::string& error, const std::string& of) {
    std::string out = error;
    for (size_t at = out.find(of); at != std::string::npos; at = out.find(of)) {
      out.replace(at, of.size(), "ID");
    }
    return out;
  };
  const auto expect_same = [&](const auto& call) {
    EXPECT_EQ(text(message(call(id).error()), id), text(message(call(nothing).error()), nothing));
    EXPECT_EQ(call(id).error().code, ErrorCode::kNotFound);
  };
  expect_same([&](const std::string& asset) { return service_->get_asset(studio_, asset); });
  expect_same([&](const std::string& asset) { return service_->delete_asset(studio_, asset); });
  expect_same(
      [&](const std::string& asset) { return service_->submit(studio_, request(asset), {}); });
  const BlobInfo manifest = put_blob("manifest");
  expect_same([&](const std::string& asset) {
    return service_->put_bundle(studio_, manifest, "b", {{"a.ply", asset}});
  });
  EXPECT_TRUE(testing::assets_of(*service_, studio_).empty());
  EXPECT_EQ(testing::assets_of(*service_, lab_).size(), 1u);
  ASSERT_TRUE(service_->delete_asset(lab_, id));
  EXPECT_EQ(service_->get_asset(lab_, id).error().code, ErrorCode::kGone);
  expect_same([&](const std::string& asset) { return service_->get_asset(studio_, asset); });
}

TEST_F(TenantsTest, jobs_results_grids_and_events_of_another_are_not_found) {
  const JobStatus job = finish(lab_, request(put(lab_, "mesh").id), "grid");
  ASSERT_EQ(job.state, JobState::kDone);
  const std::string& id = job.id;
  const auto soon = Clock::now() + milliseconds(50);
  EXPECT_EQ(message(service_->get(studio_, id).error()),
            "no such job: expected the id of a job, got " + id);
  EXPECT_EQ(service_->get_result(studio_, id).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(testing::wait_end(*service_, studio_, id).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(testing::wait_change(*service_, studio_, id, 0, soon).error().code,
            ErrorCode::kNotFound);
  EXPECT_EQ(testing::wait_events(*service_, studio_, id, 0, soon).error().code,
            ErrorCode::kNotFound);
  EXPECT_EQ(service_->cancel(studio_, id).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(service_->frames(studio_, id, {}).error().code, ErrorCode::kNotFound);
  EXPECT_TRUE(testing::jobs_of(*service_, studio_, 100).empty());
  EXPECT_TRUE(testing::jobs_of(*service_, studio_, 100, JobState::kDone).empty());
  const std::string grid = job.result->grid;
  EXPECT_EQ(message(service_->get_grid(studio_, grid).error()),
            "no such grid: expected the id of a grid, got " + grid);
  JobRequest render;
  render.kind = JobKind::kRender;
  render.grid = grid;
  EXPECT_EQ(service_->submit(studio_, render, {}).error().code, ErrorCode::kNotFound);
  EXPECT_TRUE(service_->get_grid(lab_, grid));
  EXPECT_TRUE(service_->get_result(lab_, id));
  EXPECT_EQ(testing::jobs_of(*service_, lab_, 100, JobState::kDone).size(), 1u);
}

TEST_F(TenantsTest, frames_and_sequences_of_another_are_not_found) {
  const JobStatus job = finish_sequence(lab_);
  ASSERT_TRUE(job.result);
  const std::string sequence = job.result->sequence;
  EXPECT_EQ(service_->get_sequence(lab_, sequence).value().frames.size(), 2u);
  EXPECT_EQ(message(service_->get_sequence(studio_, sequence).error()),
            "no such sequence: expected the id of a sequence, got " + sequence);
  EXPECT_TRUE(service_->get_grid(lab_, sha256_id("first")));
  EXPECT_FALSE(service_->get_grid(studio_, sha256_id("first")));
  JobRequest render;
  render.kind = JobKind::kRender;
  render.sequence = sequence;
  EXPECT_EQ(service_->submit(studio_, render, {}).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(service_->frames(boss_, job.id, {}).value().frames.size(), 2u);
}

TEST_F(TenantsTest, the_same_bytes_are_a_first_upload_for_each_and_one_blob) {
  EXPECT_FALSE(put(lab_, "mesh", "lab.ply").existed);
  EXPECT_TRUE(put(lab_, "mesh").existed);
  const Asset second = put(studio_, "mesh", "studio.ply");
  EXPECT_FALSE(second.existed);
  EXPECT_EQ(second.filename, "studio.ply");
  EXPECT_EQ(service_->get_asset(lab_, second.id).value().filename, "a.ply");
  EXPECT_EQ(blobs().list().value().size(), 1u);
  ASSERT_TRUE(service_->delete_asset(lab_, second.id));
  EXPECT_TRUE(blobs().stat(second.id)) << "the other tenant has it";
  EXPECT_TRUE(service_->get_asset(studio_, second.id));
  ASSERT_TRUE(service_->delete_asset(studio_, second.id));
  EXPECT_TRUE(is_removed(second.id));
}

TEST_F(TenantsTest, equal_work_of_another_is_done_again) {
  const std::string asset = put(lab_, "mesh").id;
  EXPECT_EQ(put(studio_, "mesh").id, asset);
  finish(lab_, request(asset), "grid");
  EXPECT_TRUE(submit_for(lab_, request(asset)).cached);
  const JobStatus first = submit_for(studio_, request(asset));
  EXPECT_FALSE(first.cached);
  EXPECT_EQ(first.state, JobState::kQueued);
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task && task->id == first.id);
  ASSERT_TRUE(worker.complete(*task, "grid"));
  EXPECT_TRUE(submit_for(studio_, request(asset)).cached);
  EXPECT_TRUE(service_->get_grid(studio_, sha256_id("grid")));
}

TEST_F(TenantsTest, work_that_was_queued_twice_is_not_cut_short_by_anothers_result) {
  const std::string asset = put(lab_, "mesh").id;
  put(studio_, "mesh");
  const std::string first = submit_for(lab_, request(asset)).id;
  const std::string second = submit_for(studio_, request(asset)).id;
  FakeWorker worker = connect();
  const auto one = worker.claim();
  ASSERT_TRUE(one && one->id == first && worker.complete(*one, "grid"));
  const auto two = worker.claim();
  ASSERT_TRUE(two && two->id == second) << "a worker does it";
  ASSERT_TRUE(worker.complete(*two, "grid"));
}

TEST_F(TenantsTest, what_was_found_in_an_asset_is_not_told_to_another_who_has_it) {
  const std::string asset = put(lab_, "mesh").id;
  put(studio_, "mesh");
  JobRequest inspect = request(asset);
  inspect.kind = JobKind::kInspect;
  finish(lab_, inspect, "description");
  EXPECT_FALSE(service_->get_asset(lab_, asset).value().description_json.empty());
  EXPECT_TRUE(service_->get_asset(studio_, asset).value().description_json.empty());
}

TEST_F(TenantsTest, a_manifest_of_another_does_not_make_the_same_bytes_a_bundle) {
  const std::string mesh = put(lab_, "mesh", "bob.md5mesh").id;
  const BlobInfo manifest = put_blob("manifest");
  ASSERT_TRUE(service_->put_bundle(lab_, manifest, "b", {{"bob.md5mesh", mesh}}));
  put(studio_, "manifest");
  const std::string id = submit_for(studio_, request(manifest.id)).id;
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task && task->id == id);
  EXPECT_TRUE(task->bundle_paths.empty());
}

TEST_F(TenantsTest, idempotency_keys_of_two_tenants_do_not_meet) {
  const std::string asset = put(lab_, "mesh").id;
  const std::string other = put(studio_, "another mesh").id;
  SubmitOptions once;
  once.idempotency_key = "1";
  const std::string first = submit_for(lab_, request(asset), once).id;
  const std::string second = submit_for(studio_, request(other), once).id;
  EXPECT_NE(first, second);
  EXPECT_EQ(submit_for(lab_, request(asset), once).id, first);
  EXPECT_EQ(submit_for(studio_, request(other), once).id, second);
}

TEST_F(TenantsTest, an_admin_sees_works_on_and_cancels_what_is_of_others) {
  const std::string asset = put(lab_, "mesh", "lab.ply").id;
  put(studio_, "mesh", "studio.ply");
  EXPECT_EQ(testing::assets_of(*service_, boss_).size(), 2u);
  EXPECT_FALSE(service_->get_asset(boss_, asset).value().filename.empty());
  const std::string id = submit_for(lab_, request(asset)).id;
  EXPECT_EQ(testing::jobs_of(*service_, boss_, 100, JobState::kQueued).size(), 1u);
  EXPECT_EQ(service_->cancel(boss_, id).value().state, JobState::kCancelled);
  EXPECT_EQ(service_->get(lab_, id).value().state, JobState::kCancelled);
  const JobStatus own = finish(boss_, request(asset), "grid");
  EXPECT_EQ(own.state, JobState::kDone);
  EXPECT_FALSE(service_->get(lab_, own.id)) << "the admin's job is the admin's";
  EXPECT_FALSE(service_->get_grid(lab_, own.result->grid));
  ASSERT_TRUE(service_->delete_asset(boss_, asset));
  EXPECT_EQ(service_->get_asset(lab_, asset).error().code, ErrorCode::kGone);
  EXPECT_EQ(service_->get_asset(studio_, asset).error().code, ErrorCode::kGone);
  EXPECT_TRUE(is_removed(asset));
}

TEST_F(TenantsTest, an_admins_job_on_a_bundle_of_another_gets_its_files) {
  const std::string mesh = put(lab_, "mesh", "bob.md5mesh").id;
  const auto bundle =
      service_->put_bundle(lab_, put_blob("manifest"), "b", {{"bob.md5mesh", mesh}});
  ASSERT_TRUE(bundle);
  submit_for(boss_, request(bundle->id));
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  EXPECT_EQ(task->bundle_paths, std::vector<std::string>{worker.input(mesh)});
  EXPECT_TRUE(std::filesystem::equivalent(worker.input(mesh), blobs().path_of(mesh)));
}

TEST_F(TenantsTest, what_the_open_daemon_made_is_the_admins_once_there_are_keys) {
  const std::string asset = put(Caller::open(), "mesh").id;
  const std::string id = submit_for(Caller::open(), request(asset)).id;
  EXPECT_FALSE(service_->get_asset(lab_, asset));
  EXPECT_FALSE(service_->get(lab_, id));
  EXPECT_TRUE(service_->get_asset(boss_, asset));
  EXPECT_TRUE(service_->get(boss_, id));
}

TEST_F(TenantsTest, nobody_sees_nothing) {
  const std::string asset = put(Caller::open(), "mesh").id;
  EXPECT_FALSE(service_->get_asset(Caller::nobody(), asset));
  EXPECT_TRUE(testing::assets_of(*service_, Caller::nobody()).empty());
}

TEST_F(TenantsTest, an_upload_that_meets_the_deletion_of_the_same_bytes_by_another_goes_through) {
  const std::string id = put(lab_, "mesh").id;
  const BlobInfo stored = put_blob("mesh");  // written, not yet registered
  ASSERT_TRUE(service_->delete_asset(lab_, id));
  EXPECT_TRUE(blobs().stat(id));
  EXPECT_TRUE(service_->put_asset(studio_, stored, "a.ply", ""));
}

}  // namespace
}  // namespace voxeld
