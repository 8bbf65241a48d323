// A job that goes on after the tiles of an earlier attempt gives the bytes of one that was never
// interrupted.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "proto/container/grid_format.h"
#include "server/base/disk/file.h"
#include "server/base/sha256.h"
#include "server/worker/run_task.h"
#include "tests/unit/base/temporary_dir.h"
#include "tests/unit/worker/fake_gateway.h"
#include "tests/unit/worker/task_completion.h"

namespace voxeld {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

// A closed octahedron with a skew, which reaches many tiles.
constexpr char kMesh[] =
    "v 1 0 0\nv -1 0.1 0\nv 0 1 0.2\nv 0 -1 0\nv 0.3 0 1\nv 0 0 -1\n"
    "f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";

class ResumeTest : public ::testing::Test {
 protected:
  ResumeTest() : engine_(open_device(gpu::DeviceId{.kind = gpu::DeviceKind::kCpu}, "").value()) {
    std::ofstream(dir_.path() / "mesh.obj") << kMesh;
    engine_.part_interval = std::chrono::milliseconds(0);  // after every step
  }

  Task task(json options) {
    options["pipeline"] = "cpu";
    Task task;
    task.id = "j-" + std::to_string(++tasks_);
    task.fence = 1;
    task.kind = JobKind::kVoxelize;
    task.input_path = (dir_.path() / "mesh.obj").string();
    task.input_hash = sha256_id(kMesh);
    task.filename = "mesh.obj";
    task.options_json = options.dump();
    return task;
  }

  // The gateway's side of a part; it cancels, as the loss of a worker would end it, after some.
  std::string take(const json& message) {
    if (message["type"] == "progress") {
      return json{{"cancel", false}, {"fenced", false}, {"preempt", preempts_}}.dump();
    }
    if (message["type"] != "part") return R"({"cancel":false,"fenced":false})";
    if (refuses_) {
      ++refused_;
      return R"({"cancel":false,"fenced":false,"error":"storage-full"})";
    }
    const fs::path stored = dir_.path() / ("stored-" + std::to_string(parts_.size()));
    EXPECT_EQ(message["position"], parts_.size());
    fs::rename(message["path"].get<std::string>(), stored);
    parts_.push_back(stored.string());
    const bool cancel = static_cast<int>(parts_.size()) == cancel_after_;
    return json{{"cancel", cancel}, {"fenced", false}}.dump();
  }

  TaskOutcome run_once(const Task& task) {
    testing::FakeGateway gateway([this](const json& message) { return take(message); });
    auto client = TaskClient::connect(gateway.address()).value();
    TaskMonitor monitor(*client, task);
    return run_task(engine_, task, dir_.path(), monitor);
  }
  Result<TaskCompletion> run(const Task& task) { return testing::completion_of(run_once(task)); }

  std::vector<std::string> outputs(const Result<TaskCompletion>& completion) {
    EXPECT_TRUE(completion.ok()) << completion.error().message();
    std::vector<std::string> hashes;
    if (!completion) return hashes;
    for (const TaskOutput& output : completion->outputs) {
      hashes.push_back(output.role + " " + sha256_id(read_file(output.path).value()));
    }
    return hashes;
  }

  testing::TemporaryDir dir_;
  Engine engine_;
  std::vector<std::string> parts_;
  int tasks_ = 0, cancel_after_ = 0, refused_ = 0;
  bool refuses_ = false, preempts_ = false;
};

TEST_F(ResumeTest, the_bytes_are_those_of_an_uninterrupted_run) {
  for (const json& options :
       {json{{"size", 1100}}, json{{"size", 700}, {"channels", "color,normal"}},
        json{{"size", 600}, {"codec", "small"}, {"format", "native"}},
        json{{"size", 700}, {"format", "npz"}}}) {
    parts_.clear();
    cancel_after_ = 0;
    const auto expected = run(task(options));
    const std::vector<std::string> whole = outputs(expected);
    const size_t steps = parts_.size() + 1;
    ASSERT_GT(steps, 3u);
    for (const int lost_after : {1, static_cast<int>(steps / 2), static_cast<int>(steps) - 1}) {
      parts_.clear();
      cancel_after_ = lost_after;
      const auto lost = run(task(options));
      ASSERT_FALSE(lost.ok());
      EXPECT_EQ(lost.error().code, ErrorCode::kCancelled);
      ASSERT_EQ(static_cast<int>(parts_.size()), lost_after);
      cancel_after_ = 0;
      Task again = task(options);
      again.part_paths = parts_;
      EXPECT_EQ(outputs(run(again)), whole) << options << lost_after;
      // New parts follow on the old ones, and no step was done twice.
      EXPECT_EQ(parts_.size() + 1, steps);
    }
  }
}

TEST_F(ResumeTest, the_name_of_a_result_has_no_control_characters) {
  Task named = task({{"size", 16}});
  named.filename = "a\nb\x7f.obj";
  const auto completion = run(named);
  ASSERT_TRUE(completion) << completion.error().message();
  ASSERT_FALSE(completion->outputs.empty());
  for (const TaskOutput& output : completion->outputs) {
    EXPECT_TRUE(output.filename.starts_with("a_b_.")) << output.filename;
  }
}

TEST_F(ResumeTest, parts_of_other_work_are_left_aside) {
  (void)run(task({{"size", 1100}}));
  const std::vector<std::string> others = parts_;
  ASSERT_FALSE(others.empty());
  parts_.clear();
  const std::vector<std::string> expected = outputs(run(task({{"size", 1000}})));
  const std::vector<std::string> own = parts_;
  ASSERT_GT(own.size(), 1u);
  const auto tried = [&](std::vector<std::string> paths) {
    parts_.clear();
    Task again = task({{"size", 1000}});
    again.part_paths = std::move(paths);
    return outputs(run(again));
  };
  EXPECT_EQ(tried(others), expected);
  EXPECT_EQ(tried({own[1], own[0]}), expected) << "not in their order";
  EXPECT_EQ(tried({(dir_.path() / "mesh.obj").string()}), expected) << "no container";
  EXPECT_EQ(tried({(dir_.path() / "nothing").string()}), expected);
}

TEST_F(ResumeTest, a_part_that_cannot_be_stored_costs_the_job_nothing) {
  const std::vector<std::string> expected = outputs(run(task({{"size", 1100}})));
  refuses_ = true;
  EXPECT_EQ(outputs(run(task({{"size", 1100}}))), expected);
  EXPECT_EQ(refused_, 1) << "no later part is tried";
}

TEST_F(ResumeTest, a_task_that_is_preempted_again_and_again_ends_with_the_same_bytes) {
  const json options = {{"size", 2000}, {"channels", "color,normal"}};
  engine_.part_interval = std::chrono::hours(1);
  const std::vector<std::string> whole = outputs(run(task(options)));
  ASSERT_TRUE(parts_.empty());
  int times = 0;
  for (bool ended = false; !ended;) {
    preempts_ = times < 3;
    Task again = task(options);
    again.part_paths = parts_;
    const size_t parts_before = parts_.size();
    const TaskOutcome outcome = run_once(again);
    const auto* preempted = std::get_if<TaskPreemption>(&outcome);
    ended = preempted == nullptr;
    if (ended) {
      EXPECT_EQ(outputs(testing::completion_of(outcome)), whole);
      continue;
    }
    ++times;
    EXPECT_EQ(preempted->task, again.id);
    EXPECT_GT(preempted->tiles_done, 0);
    EXPECT_EQ(preempted->timings.back().first, "encode");
    EXPECT_EQ(parts_.size(), parts_before + 1) << "each attempt got further";
  }
  EXPECT_GT(times, 0);
}

TEST_F(ResumeTest, a_task_whose_part_cannot_be_stored_is_not_preempted) {
  const json options = {{"size", 2000}, {"channels", "color,normal"}};
  engine_.part_interval = std::chrono::hours(1);
  preempts_ = refuses_ = true;
  EXPECT_TRUE(std::holds_alternative<TaskCompletion>(run_once(task(options))));
}

TEST_F(ResumeTest, solids_are_not_preempted) {
  engine_.part_interval = std::chrono::hours(1);
  preempts_ = true;
  const Task solid = task({{"size", 700}, {"fill", "solid"}, {"channels", "color,normal"}});
  EXPECT_TRUE(std::holds_alternative<TaskCompletion>(run_once(solid)));
}

TEST_F(ResumeTest, a_part_is_a_container_of_its_own_tiles) {
  (void)run(task({{"size", 1100}}));
  uint64_t voxels = 0;
  int64_t steps_done = 0;
  for (const std::string& path : parts_) {
    const auto bytes = read_file(path).value();
    const auto reader = GridReader::open(bytes);
    ASSERT_TRUE(reader.ok()) << reader.error().message();
    EXPECT_TRUE(reader->decode_tiles().ok());
    voxels += reader->voxel_count();
    const json meta = json::parse(reader->header().meta_json);
    EXPECT_GT(meta["steps_done"].get<int64_t>(), steps_done);
    steps_done = meta["steps_done"].get<int64_t>();
  }
  EXPECT_GT(voxels, 100'000u);
}

}  // namespace
}  // namespace voxeld
