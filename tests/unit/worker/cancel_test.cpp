// A task that is cancelled while its file is read: it ends, and its worker goes on.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/worker/worker.h"
#include "tests/unit/worker/fake_gateway.h"

namespace voxeld {
namespace {

using nlohmann::json;
using testing::FakeGateway;

// Polygons of the most corners, which all stand at four places: seconds of work.
void write_slow_obj(const std::filesystem::path& path, int polygons) {
  std::ofstream out(path);
  out << "v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\n";
  std::string face = "f";
  for (int corner = 0; corner < 65'535; ++corner) face += " " + std::to_string(1 + corner % 4);
  for (int i = 0; i < polygons; ++i) out << face << "\n";
}

struct CancelledRun {
  int reports = 0;  // while the file is read
  int claims = 0;
  json failure;
};

// Gives a worker the mesh of the folder, and cancels the task with its first report, or with the
// first one after the file was read.
CancelledRun run_until_cancelled(const std::filesystem::path& folder, bool is_read_first) {
  CancelledRun run;
  FakeGateway gateway([&](const json& message) -> std::string {
    const std::string type = message.value("type", "");
    if (type == "progress") {
      const bool is_reading = message["stage"] == "parse";
      run.reports += is_reading ? 1 : 0;
      return json{{"cancel", !is_reading || !is_read_first}, {"fenced", false}}.dump();
    }
    if (type == "fail") run.failure = message["error"];
    if (type != "claim") return json{{"ok", true}}.dump();
    if (++run.claims > 1) return "";  // the gateway goes
    Task task;
    task.id = "j-1";
    task.fence = 1;
    task.input_path = (folder / "mesh.obj").string();
    task.input_hash = "sha256-1";
    task.filename = "mesh.obj";
    task.options_json = R"({"size":16})";
    return json{{"task", to_json_message(task)}}.dump();
  });
  Engine engine(open_device(gpu::DeviceId{.kind = gpu::DeviceKind::kCpu}, "").value());
  const auto client = TaskClient::connect(gateway.address()).value();
  EXPECT_EQ(serve_tasks(engine, *client, nullptr, folder), 0);
  return run;
}

// A worker reports ten times a second, so reports compare times. The control reads the whole file.
TEST(Cancel, reading_a_file_stops_early_and_the_worker_claims_again) {
  testing::TemporaryDir dir;
  write_slow_obj(dir.path() / "mesh.obj", 60);
  const CancelledRun control = run_until_cancelled(dir.path(), true);
  CancelledRun run = run_until_cancelled(dir.path(), false);
  EXPECT_EQ(run.claims, 2);
  EXPECT_EQ(run.failure["code"], "cancelled");
  EXPECT_GE(run.reports, 1);
  EXPECT_LT(2 * run.reports, control.reports);
}

}  // namespace
}  // namespace voxeld
