// The loop of a worker over its tasks, and its end.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "server/worker/worker.h"
#include "tests/unit/worker/fake_gateway.h"

namespace voxeld {
namespace {

using nlohmann::json;
using testing::FakeGateway;

// A device that fails as drivers do.
class BrokenPipeline final : public TilePipeline {
 public:
  Status begin_job(const VoxelizePlan&, VoxelizeStats&) override {
    return Error{ErrorCode::kDeviceUnavailable, "after the raster pass: GL_CONTEXT_LOST", "", ""};
  }
  Status run_tiles(std::span<const TileBin>, const Pause&, std::vector<SparseTile>&) override {
    return {};
  }
  void end_job() override {}
  int64_t device_bytes(const Scene&, const WantedChannels&) const override { return 0; }
  DeviceTraits traits() const override { return {}; }
};

constexpr const char* kTriangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

class TaskLoopTest : public ::testing::Test {
 protected:
  // Gives the worker one task and then goes away; returns the status that the worker ends with.
  // `context`: what the driver says of it after the task has failed.
  int run(const Status& context) {
    std::ofstream(dir_.path() / "mesh.obj") << kTriangle;
    bool given = false;
    FakeGateway gateway([&](const json& message) -> std::string {
      const std::string type = message.value("type", "");
      if (type != "progress") messages_.push_back(type);
      if (type == "claim" && given) return "";  // the gateway goes
      if (type != "claim") return json{{"ok", true}}.dump();
      given = true;
      Task task;
      task.id = "j-1";
      task.fence = 1;
      task.input_path = (dir_.path() / "mesh.obj").string();
      task.input_hash = "sha256-1";
      task.filename = "mesh.obj";
      task.options_json = R"({"size":16,"pipeline":"compute"})";
      return json{{"task", to_json_message(task)}}.dump();
    });
    OpenedDevice device = open_device(gpu::DeviceId{.kind = gpu::DeviceKind::kCpu}, "").value();
    device.pipeline = std::make_unique<BrokenPipeline>();
    device.check = [&](std::string_view) { return context; };
    Engine engine(std::move(device));
    const auto client = TaskClient::connect(gateway.address()).value();
    return serve_tasks(engine, *client, nullptr, dir_.path());
  }

  testing::TemporaryDir dir_;
  std::vector<std::string> messages_;
};

// No word on the task: the gateway puts it back when the connection ends with the process.
TEST_F(TaskLoopTest, a_worker_whose_context_is_lost_ends_without_failing_its_job) {
  const Error lost{ErrorCode::kDeviceUnavailable, "the device was reset", "", ""};
  EXPECT_EQ(run(lost), 4);
  EXPECT_EQ(messages_, std::vector<std::string>{"claim"});
}

TEST_F(TaskLoopTest, a_worker_whose_context_is_good_fails_the_job_and_goes_on) {
  EXPECT_EQ(run({}), 0);
  EXPECT_EQ(messages_, (std::vector<std::string>{"claim", "fail", "claim"}));
}

}  // namespace
}  // namespace voxeld
