// Whole tasks on a context, from the files of their inputs to the files of their outputs.
#include "server/worker/run_task.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "server/base/sha256.h"
#include "tests/unit/worker/fake_gateway.h"
#include "tests/unit/worker/task_completion.h"

namespace voxeld {
namespace {

using nlohmann::json;

// Corners of a unit cube, closed, with two triangles to a side.
constexpr const char* kCube =
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
    "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

Engine& engine() {
  static Engine instance = [] {
    const char* name = std::getenv("VOXELD_TEST_DEVICE");
    const auto device = gpu::parse_device(name == nullptr ? "llvmpipe" : name);
    return Engine(open_device(device.value(), "").value());
  }();
  return instance;
}

bool has_gl() {
  return engine().device.info.device.kind != gpu::DeviceKind::kCpu;
}

class RunTaskTest : public ::testing::Test {
 protected:
  RunTaskTest()
      : gateway_([this](const json&) {
          return json{{"cancel", cancel_.load()}, {"fenced", false}}.dump();
        }),
        client_(TaskClient::connect(gateway_.address()).value()) {
    engine().cache = {};
  }
  Task task(JobKind kind, const std::string& input, const std::string& options,
            const std::string& filename = "models/cube.obj") {
    Task task;
    task.id = "j-" + std::to_string(++tasks_);
    task.fence = 1;
    task.kind = kind;
    task.input_path = (dir_.path() / ("input" + std::to_string(tasks_))).string();
    std::ofstream(task.input_path, std::ios::binary) << input;
    task.input_hash = sha256_id(input);
    task.filename = filename;
    task.options_json = options;
    return task;
  }
  Task grid_task(JobKind kind, const TaskCompletion& made, const std::string& options) {
    const auto bytes = read_file(output(made, "grid").path).value();
    Task result = task(kind, std::string(bytes.begin(), bytes.end()), options, "");
    result.input_is_grid = true;
    return result;
  }
  Result<TaskCompletion> run(const Task& task) {
    TaskMonitor monitor(*client_, task);
    return testing::completion_of(run_task(engine(), task, dir_.path(), monitor));
  }
  static TaskOutput output(const TaskCompletion& completion, const std::string& role) {
    for (const TaskOutput& output : completion.outputs) {
      if (output.role == role) return output;
    }
    ADD_FAILURE() << "no output " << role;
    return {};
  }
  static std::vector<std::string> stages(const TaskCompletion& completion) {
    std::vector<std::string> names;
    for (const auto& [name, ms] : completion.timings) names.push_back(name);
    return names;
  }
  testing::TemporaryDir dir_;
  std::atomic<bool> cancel_{false};
  int tasks_ = 0;
  testing::FakeGateway gateway_;
  std::unique_ptr<TaskClient> client_;
};

TEST_F(RunTaskTest, a_mesh_becomes_a_container_and_the_format_asked_for) {
  const auto done = run(task(JobKind::kVoxelize, kCube, R"({"size":8,"format":"npy"})"));
  ASSERT_TRUE(done) << done.error().message();
  EXPECT_EQ(done->task, "j-1");
  EXPECT_EQ(done->fence, 1);
  EXPECT_EQ(stages(*done), (std::vector<std::string>{"parse", "voxelize", "encode"}));
  const json meta = json::parse(done->meta_json);
  EXPECT_EQ(meta["dims"], json({8, 8, 8}));
  EXPECT_EQ(meta["voxel_count"], 8 * 8 * 8 - 6 * 6 * 6);
  EXPECT_EQ(meta["voxel_size"], json({0.125, 0.125, 0.125}));
  EXPECT_EQ(meta["source_hash"], sha256_id(kCube));
  EXPECT_EQ(meta["source_format"], "obj");
  EXPECT_EQ(meta["options"]["size"], 8);
  EXPECT_FALSE(meta["options"].contains("format"));
  for (const char* name : {"pipeline", "pipeline_reason", "device", "renderer", "driver", "units",
                           "origin", "triangles", "content_hash", "algorithm_version"}) {
    EXPECT_TRUE(meta.contains(name)) << name;
  }
  EXPECT_EQ(output(*done, "result").filename, "cube.npy");
  EXPECT_EQ(output(*done, "result").media_type, "application/x-npy");
  EXPECT_EQ(output(*done, "grid").filename, "cube.voxg");
  EXPECT_EQ(read_file(output(*done, "result").path).value()[1], 'N');
}

TEST_F(RunTaskTest, an_image_names_its_renderer) {
  const auto image = [&](const std::string& renderer) {
    return run(task(JobKind::kRender, kCube,
                    R"({"size":8,"width":16,"height":16,"renderer":")" + renderer + "\"}"));
  };
  for (const std::string renderer : {"auto", "cpu", "auto"}) {
    const auto done = image(renderer);
    ASSERT_TRUE(done) << done.error().message();
    const bool by_gl = renderer == "auto" && !engine().device.info.is_software;
    EXPECT_EQ(json::parse(done->meta_json)["drawn_by"], by_gl ? "gl" : "cpu");
  }
  const auto by_gl = image("gl");
  ASSERT_EQ(by_gl.ok(), has_gl());
  if (has_gl()) {
    const json meta = json::parse(by_gl->meta_json);
    EXPECT_EQ(meta["drawn_by"], "gl");
    EXPECT_GT(meta["device_bytes_peak"].get<int64_t>(), 0);
  } else {
    EXPECT_EQ(by_gl.error().code, ErrorCode::kUnsupportedFeature);
  }
}

TEST_F(RunTaskTest, a_native_result_is_the_grid_itself) {
  const auto done = run(task(JobKind::kVoxelize, kCube, R"({"size":8,"format":"native"})"));
  ASSERT_TRUE(done) << done.error().message();
  EXPECT_EQ(output(*done, "result").path, output(*done, "grid").path);
}

TEST_F(RunTaskTest, both_pipelines_and_every_output_format_leave_the_same_container) {
  std::string first;
  for (const char* options :
       {R"({"size":20,"format":"npy","pipeline":"compute"})",
        R"({"size":20,"format":"vox","pipeline":"raster"})", R"({"size":20,"format":"npz"})"}) {
    const auto done = run(task(JobKind::kVoxelize, kCube, options));
    if (!has_gl() && std::string_view(options).find("pipeline") != std::string_view::npos) {
      ASSERT_FALSE(done);
      EXPECT_EQ(done.error().code, ErrorCode::kUnsupportedFeature);
      continue;
    }
    ASSERT_TRUE(done) << done.error().message();
    const std::string id = sha256_id(read_file(output(*done, "grid").path).value());
    if (first.empty()) first = id;
    EXPECT_EQ(id, first) << options;
  }
}

TEST_F(RunTaskTest, a_grid_is_exported_and_drawn_without_its_mesh) {
  const auto made = run(task(JobKind::kVoxelize, kCube, R"({"size":8,"format":"native"})"));
  ASSERT_TRUE(made);
  const auto exported = run(grid_task(JobKind::kExport, *made, R"({"format":"npy"})"));
  ASSERT_TRUE(exported) << exported.error().message();
  EXPECT_EQ(json::parse(exported->meta_json)["voxel_count"], 296);
  EXPECT_EQ(json::parse(exported->meta_json)["source_hash"], sha256_id(kCube));
  EXPECT_EQ(exported->outputs.size(), 1u);
  const auto drawn = run(grid_task(JobKind::kRender, *made, R"({"width":32,"height":16})"));
  ASSERT_TRUE(drawn) << drawn.error().message();
  EXPECT_EQ(output(*drawn, "result").media_type, "image/png");
  EXPECT_EQ(json::parse(drawn->meta_json)["width"], 32);
  EXPECT_EQ(stages(*drawn), (std::vector<std::string>{"parse", "render", "encode"}));
}

TEST_F(RunTaskTest, a_second_view_of_a_mesh_is_not_voxelized_again) {
  const auto first = run(task(JobKind::kRender, kCube, R"({"size":8,"width":16,"height":16})"));
  ASSERT_TRUE(first) << first.error().message();
  const auto second =
      run(task(JobKind::kRender, kCube, R"({"size":8,"width":16,"height":16,"azimuth":90})"));
  ASSERT_TRUE(second);
  EXPECT_EQ(stages(*second), (std::vector<std::string>{"encode", "render"}));
  EXPECT_EQ(read_file(output(*first, "grid").path).value(),
            read_file(output(*second, "grid").path).value());
  const auto other = run(task(JobKind::kRender, kCube, R"({"size":9,"width":16,"height":16})"));
  ASSERT_TRUE(other);
  EXPECT_EQ(json::parse(other->meta_json)["dims"], json({9, 9, 9}));
}

TEST_F(RunTaskTest, a_level_of_a_grid_is_a_grid) {
  const auto made = run(task(JobKind::kVoxelize, kCube, R"({"size":600,"format":"native"})"));
  ASSERT_TRUE(made) << made.error().message();
  const json whole = json::parse(made->meta_json);
  const auto level = run(grid_task(JobKind::kExport, *made, R"({"level":2})"));
  ASSERT_TRUE(level) << level.error().message();
  EXPECT_EQ(output(*level, "grid").path, output(*level, "result").path);
  const json meta = json::parse(level->meta_json);
  EXPECT_EQ(meta["dims"], json({150, 150, 150}));
  EXPECT_EQ(meta["voxel_count"], 150 * 150 * 150 - 148 * 148 * 148);
  EXPECT_EQ(meta["level"], 2);
  EXPECT_EQ(meta["level_rule"], "any");
  EXPECT_EQ(meta["of"]["content_hash"], whole["content_hash"]);
  EXPECT_NE(meta["content_hash"], whole["content_hash"]);
  EXPECT_GT(meta["host_bytes_peak"].get<int64_t>(), 1 << 20);
  // It is what a voxelization at that size gives here: the cube's faces are faces of cells.
  const auto direct = run(task(JobKind::kVoxelize, kCube, R"({"size":150,"format":"native"})"));
  EXPECT_EQ(json::parse(direct->meta_json)["content_hash"], meta["content_hash"]);
  // And the same comes from the mesh at once, beside the whole grid.
  const auto once = run(task(JobKind::kVoxelize, kCube, R"({"size":600,"level":2})"));
  ASSERT_TRUE(once) << once.error().message();
  EXPECT_EQ(json::parse(once->meta_json)["content_hash"], meta["content_hash"]);
  EXPECT_EQ(read_file(output(*once, "result").path).value(),
            read_file(output(*level, "result").path).value());
  const auto npy =
      run(grid_task(JobKind::kExport, *made, R"({"region":"0,0,0,600,600,1","format":"npy"})"));
  ASSERT_TRUE(npy) << npy.error().message();
  EXPECT_EQ(json::parse(npy->meta_json)["voxel_count"], 600 * 600);
  EXPECT_EQ(run(grid_task(JobKind::kExport, *made, R"({"region":"0,0,0,601,1,1"})")).error().code,
            ErrorCode::kInvalidOption);
}

TEST_F(RunTaskTest, the_estimate_of_memory_bounds_the_peak) {
  const auto expect_bounded = [](const Result<TaskCompletion>& done, const std::string& what) {
    ASSERT_TRUE(done) << done.error().message();
    const json meta = json::parse(done->meta_json);
    const auto peak = meta.at("host_bytes_peak").get<int64_t>();
    const auto estimate = meta.at("host_bytes_estimate").get<int64_t>();
    EXPECT_GT(peak, 1 << 20) << what;
    EXPECT_GE(estimate, peak) << what;
    // It would be of no use if it said everything.
    EXPECT_LT(estimate, peak + (int64_t{5} << 30)) << what;
  };
  for (const int size : {16, 256, 1000, 3000}) {
    const std::string text = "{\"size\":" + std::to_string(size);
    const auto made = run(task(JobKind::kVoxelize, kCube, text + "}"));
    expect_bounded(made, text);
    expect_bounded(run(grid_task(JobKind::kExport, *made, R"({"level":1})")), text + " level");
    expect_bounded(run(grid_task(JobKind::kRender, *made, R"({"width":64,"height":64})")),
                   text + " image");
    if (size > 300) continue;
    expect_bounded(run(task(JobKind::kVoxelize, kCube, text + R"(,"fill":"solid"})")),
                   text + " solid");
    expect_bounded(run(task(JobKind::kVoxelize, kCube,
                            text + R"(,"format":"npz","channels":"color,normal"})")),
                   text + " npz");
  }
}

TEST_F(RunTaskTest, a_grid_that_does_not_fit_is_drawn_in_part_or_coarser_and_looks_the_same) {
  const auto made = run(task(JobKind::kVoxelize, kCube, R"({"size":1000,"format":"native"})"));
  ASSERT_TRUE(made) << made.error().message();
  const auto draw = [&](const std::string& more, size_t bytes_max) {
    engine().cache = {};
    engine().image_limits.bytes_max = bytes_max;
    // A face of the cube, in light that does not depend on voxels beside it.
    auto drawn = run(grid_task(JobKind::kRender, *made,
                               R"({"width":128,"height":128,"style":"iso","occlusion":"no",)"
                               R"("projection":"perspective","azimuth":30,"elevation":20)" +
                                   more + "}"));
    engine().image_limits = {};
    EXPECT_TRUE(drawn) << drawn.error().message();
    return drawn;
  };
  constexpr size_t kLarge = size_t{1} << 30, kSmall = size_t{4} << 20;
  const auto whole = draw("", kLarge), coarse = draw("", kSmall);
  EXPECT_EQ(json::parse(whole->meta_json)["drawn"]["level"], 0);
  const json drawn = json::parse(coarse->meta_json);
  EXPECT_GE(drawn["drawn"]["level"].get<int>(), 1);
  EXPECT_EQ(drawn["drawn"]["tiles"], drawn["drawn"]["tiles_in_grid"]);
  EXPECT_EQ(drawn["dims"], json({1000, 1000, 1000}));
  // A close-up takes single voxels of the few tiles in view, and is the same image.
  const auto near_whole = draw(R"(,"zoom":30)", kLarge), near = draw(R"(,"zoom":30)", kSmall);
  const json part = json::parse(near->meta_json)["drawn"];
  EXPECT_EQ(part["level"], 0);
  EXPECT_LT(part["tiles"].get<int>(), part["tiles_in_grid"].get<int>() / 3);
  EXPECT_EQ(read_file(output(*near, "result").path).value(),
            read_file(output(*near_whole, "result").path).value());
}

TEST_F(RunTaskTest, an_image_of_the_same_part_reads_nothing_again) {
  const auto made = run(task(JobKind::kVoxelize, kCube, R"({"size":1000,"format":"native"})"));
  ASSERT_TRUE(made);
  engine().cache = {};
  engine().image_limits.bytes_max = size_t{4} << 20;
  const auto first = run(grid_task(JobKind::kRender, *made,
                                   R"({"width":64,"height":64,"style":"iso","occlusion":"no"})"));
  ASSERT_TRUE(first) << first.error().message();
  const auto* resident = engine().cache.image.get();
  ASSERT_NE(resident, nullptr);
  const auto second =
      run(grid_task(JobKind::kRender, *made,
                    R"({"width":64,"height":64,"style":"iso","occlusion":"no","azimuth":31})"));
  engine().image_limits = {};
  ASSERT_TRUE(second);
  EXPECT_EQ(engine().cache.image.get(), resident);
  EXPECT_NE(read_file(output(*first, "result").path).value(),
            read_file(output(*second, "result").path).value());
}

TEST_F(RunTaskTest, a_dense_output_over_the_limit_is_refused_before_it_is_computed) {
  const auto done = run(task(JobKind::kVoxelize, kCube, R"({"size":2048,"format":"npy"})"));
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::kGridTooLarge);
  EXPECT_TRUE(std::filesystem::directory_iterator(dir_.path()) !=
              std::filesystem::directory_iterator());
  for (const auto& entry : std::filesystem::directory_iterator(dir_.path())) {
    EXPECT_TRUE(entry.path().filename().string().starts_with("input")) << entry.path();
  }
}

TEST_F(RunTaskTest, a_cancel_ends_the_task_within_a_tile) {
  cancel_ = true;
  const Task long_task = task(JobKind::kVoxelize, kCube, R"({"size":1024,"format":"native"})");
  TaskMonitor monitor(*client_, long_task);
  while (monitor.check()) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  const auto done = testing::completion_of(run_task(engine(), long_task, dir_.path(), monitor));
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::kCancelled);
}

TEST_F(RunTaskTest, an_inspection_describes_the_mesh) {
  const auto done = run(task(JobKind::kInspect, kCube, "{}"));
  ASSERT_TRUE(done) << done.error().message();
  const json meta = json::parse(done->meta_json);
  EXPECT_EQ(meta["triangles"], 12);
  EXPECT_EQ(meta["watertight"], true);
  EXPECT_EQ(meta["bounds"]["max"], json({1.0, 1.0, 1.0}));
  EXPECT_EQ(output(*done, "result").media_type, "application/json");
}

TEST_F(RunTaskTest, bad_meshes_grids_options_and_missing_inputs_are_errors) {
  EXPECT_EQ(run(task(JobKind::kVoxelize, "v 1 2\nf 1 2 3\n", "{}")).error().code,
            ErrorCode::kMalformedMesh);
  EXPECT_EQ(run(task(JobKind::kVoxelize, kCube, R"({"sise":8})")).error().code,
            ErrorCode::kUnknownOption);
  Task no_grid = task(JobKind::kExport, "not a container", R"({"format":"npy"})", "");
  no_grid.input_is_grid = true;
  EXPECT_EQ(run(no_grid).error().code, ErrorCode::kBadRequest);
  Task gone = task(JobKind::kVoxelize, kCube, "{}");
  std::filesystem::remove(gone.input_path);
  EXPECT_EQ(run(gone).error().code, ErrorCode::kInternal);
}

TEST_F(RunTaskTest, a_missing_texture_is_a_warning) {
  const auto done = run(task(JobKind::kVoxelize, std::string("mtllib no.mtl\n") + kCube,
                             R"({"size":8,"format":"native"})"));
  ASSERT_TRUE(done) << done.error().message();
  ASSERT_FALSE(done->warnings.empty());
  EXPECT_NE(done->warnings[0].detail.find("no.mtl"), std::string::npos);
}

}  // namespace
}  // namespace voxeld
