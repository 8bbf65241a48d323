// Pipeline compute in batches of tiles, as hardware runs it: every arithmetic, size of batch and
// way to hold the mesh gives the bytes of pipeline cpu.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tests/gpu/voxel/pipelines.h"
#include "tests/unit/long_form.h"

namespace voxeld::pipelines {
namespace {

struct Forced {
  std::string name;
  GlTuning tuning;
  bool in_gate_across_tiles = false;  // the gate takes all of them within one tile
};

std::vector<Forced> forced_tunings() {
  return {{"64-bit integers", {.batches = true, .int64 = true}},
          {"two words", {.batches = true, .int64 = false}},
          {"one tile at a time", {.batches = true, .batch_tiles = 1}, true},
          {"five tiles at a time, two words",
           {.batches = true, .int64 = false, .batch_tiles = 5},
           true},
          {"one group of work items a dispatch", {.batches = true, .dispatch_columns = 1}, true},
          {"windows, one group a dispatch", {.batches = false, .dispatch_columns = 1}},
          // Neither the mesh nor the lists of work items fit.
          {"small buffers", {.batches = true, .storage_bytes = 1 << 16}, true},
          {"windows, two words", {.batches = false, .int64 = false}, true}};
}

void expect_same_tiles(const Scene& scene, const VoxelizeOptions& options, size_t voxels_min,
                       const std::vector<Forced>& tunings) {
  const Grid expected = voxelize(scene, options, PipelineChoice::kCpu);
  EXPECT_GT(voxel_count(expected), voxels_min);
  for (const Forced& forced : tunings) {
    Voxelizer one(
        std::make_unique<GlPipeline>(gpu::test_context(), shared_shaders(), forced.tuning));
    const Grid grid = voxelize_on(one, scene, options, PipelineChoice::kCompute);
    EXPECT_TRUE(grid.tiles == expected.tiles) << forced.name;
  }
}

TEST(Batches, every_tuning_gives_the_same_bytes_for_soups) {
  const Scene scene = soup(61, {.count = 3000, .extent = 64, .size_max = 30, .colors = true});
  for (const Rule rule : {Rule::kTouch, Rule::kThin, Rule::kCenter}) {
    VoxelizeOptions options = unit_cells({64, 64, 64});
    options.color = ColorMode::kNone;
    options.rule = rule;
    expect_same_tiles(scene, options, 10'000, forced_tunings());
  }
}

TEST(Batches, every_tuning_gives_the_same_bytes_across_tiles) {
  const Scene scene = soup(62, {.count = 400, .extent = 600, .size_max = 500});
  VoxelizeOptions options = unit_cells({600, 600, 600});
  options.color = ColorMode::kNone;
  std::vector<Forced> tunings = forced_tunings();
  if (!long_form())
    std::erase_if(tunings, [](const Forced& one) { return !one.in_gate_across_tiles; });
  expect_same_tiles(scene, options, 1'000'000, tunings);
}

TEST(Batches, every_tuning_gives_the_same_attributes) {
  const Scene scene = soup(63, {.count = 600, .extent = 300, .size_max = 60, .colors = true});
  VoxelizeOptions options = unit_cells({300, 300, 300});
  options.channels = ChannelSet{.color = true, .normal = true};
  const Grid expected = voxelize(scene, options, PipelineChoice::kCpu);
  for (const size_t tiles : {1u, 3u, 64u}) {
    Voxelizer one(std::make_unique<GlPipeline>(gpu::test_context(), shared_shaders(),
                                               GlTuning{.batches = true, .batch_tiles = tiles}));
    const Grid grid = voxelize_on(one, scene, options, PipelineChoice::kCompute);
    EXPECT_TRUE(grid.tiles == expected.tiles) << tiles;
  }
}

TEST(Batches, short_dispatches_give_the_same_attributes) {
  const Scene scene = soup(67, {.count = 300, .extent = 100, .size_max = 60, .colors = true});
  VoxelizeOptions options = unit_cells({100, 100, 100});
  options.channels = ChannelSet{.color = true, .normal = true};
  const Grid expected = voxelize(scene, options, PipelineChoice::kCpu);
  for (const bool batches : {true, false}) {
    Voxelizer one(
        std::make_unique<GlPipeline>(gpu::test_context(), shared_shaders(),
                                     GlTuning{.batches = batches, .dispatch_columns = 1}));
    for (const PipelineChoice pipeline : {PipelineChoice::kCompute, PipelineChoice::kRaster}) {
      const Grid grid = voxelize_on(one, scene, options, pipeline);
      EXPECT_TRUE(grid.tiles == expected.tiles) << batches << " " << static_cast<int>(pipeline);
    }
  }
}

// Counts the calls of progress that a job without and with a cap of its dispatches makes, and
// cancels it at each of the latter.
TEST(Batches, a_job_is_cancelled_between_the_dispatches_of_a_batch) {
  const Scene scene = soup(68, {.count = 200, .extent = 200, .size_max = 60});
  for (const PipelineChoice pipeline : {PipelineChoice::kCompute, PipelineChoice::kRaster}) {
    VoxelizeOptions options = unit_cells({200, 200, 200});
    options.color = ColorMode::kNone;
    options.pipeline = pipeline;
    const auto calls = [&](std::optional<double> columns, int allowed, Status* ended) {
      Voxelizer one(
          std::make_unique<GlPipeline>(gpu::test_context(), shared_shaders(),
                                       GlTuning{.batches = true, .dispatch_columns = columns}));
      int seen = 0;
      auto grid = one.voxelize(
          scene, options, [&](int64_t, int64_t) { return seen++ < allowed; }, nullptr);
      *ended = grid.ok() ? Status() : Status(std::move(grid).error());
      return seen;
    };
    Status ended;
    const int plain = calls({}, 1'000'000, &ended);
    ASSERT_TRUE(ended) << ended.error().message();
    const int capped = calls(64.0 * 64, 1'000'000, &ended);
    ASSERT_TRUE(ended) << ended.error().message();
    EXPECT_GT(capped, plain) << static_cast<int>(pipeline);
    for (int allowed = 0; allowed < std::min(capped, 12); ++allowed) {
      EXPECT_EQ(calls(64.0 * 64, allowed, &ended), allowed + 1);
      ASSERT_FALSE(ended.ok());
      EXPECT_EQ(ended.error().code, ErrorCode::kCancelled);
    }
  }
}

// Sums that carried before a job was cancelled must not reach the next job.
TEST(Batches, a_cancelled_job_leaves_no_carries) {
  MeshPart part;
  for (int i = 0; i < 100; ++i) {
    add_quad(part, {glm::dvec3(0, 0, 0.5), {8, 0, 0.5}, {8, 8, 0.5}, {0, 8, 0.5}});
  }
  // 100 squares of weight 4096 and 0.4 * 65535 are above 2^33.
  part.colors.assign(part.positions.size(), glm::vec4(0.4f, 0.4f, 0.4f, 1.0f));
  const Scene scene = scene_of(part);
  VoxelizeOptions options = unit_cells({8, 8, 1});
  const Grid expected = voxelize(scene, options, PipelineChoice::kCpu);
  for (const bool batches : {true, false}) {
    for (const PipelineChoice pipeline : {PipelineChoice::kCompute, PipelineChoice::kRaster}) {
      Voxelizer one(
          std::make_unique<GlPipeline>(gpu::test_context(), shared_shaders(),
                                       GlTuning{.batches = batches, .dispatch_columns = 1}));
      options.pipeline = pipeline;
      // Cancels the job at a call of its progress. True if it ended before.
      const auto ends_before = [&](int call) {
        int seen = 0;
        const auto grid = one.voxelize(
            scene, options, [&](int64_t, int64_t) { return seen++ != call; }, nullptr);
        return grid.ok();
      };
      int call = 0;
      for (; call < 200 && !ends_before(call); ++call) {
        const Grid grid = voxelize_on(one, scene, options, pipeline);
        EXPECT_TRUE(grid.tiles == expected.tiles) << batches << " cancelled at call " << call;
      }
      EXPECT_GT(call, 0) << "never cancelled";
    }
  }
}

TEST(DispatchPace, takes_the_work_of_50_ms) {
  DispatchPace pace(gpu::test_context(), {});
  const Workload work{.tiles = 1, .triangles = 1000, .columns = 25'000};
  pace.begin_job(nullptr, work, false);  // 4 ns a column, 25 columns a triangle
  EXPECT_EQ(pace.items(64), 12'500'000 / 25 / 64 * 64);
  EXPECT_EQ(pace.items(16), 12'500'000 / 16 / 64 * 64);
  EXPECT_EQ(pace.triangles(), 12'500'000 / 25 / 64 * 64);
  pace.begin_job(nullptr, work, true);  // 40 ns
  EXPECT_EQ(pace.items(16), 1'250'000 / 16 / 64 * 64);
  const CostModel measured{.column_ns = 0.5};
  pace.begin_job(&measured, work, false);
  EXPECT_EQ(pace.items(16), 100'000'000 / 16 / 64 * 64);
  // Triangles that seem to be tiny may not be.
  pace.begin_job(&measured, {.tiles = 1, .triangles = 1000, .columns = 1000}, false);
  EXPECT_EQ(pace.items(64), 100'000'000 / 8 / 64 * 64);
  EXPECT_EQ(pace.triangles(), 100'000'000 / 8 / 64 * 64);
  const CostModel slow{.column_ns = 1e9};
  pace.begin_job(&slow, work, false);
  EXPECT_EQ(pace.items(64), 64u);
  EXPECT_EQ(pace.triangles(), 64u);
  const CostModel unseen{};
  pace.begin_job(&unseen, {}, false);
  EXPECT_EQ(pace.triangles(), size_t{1} << 30);
}

TEST(Batches, raster_without_64_bit_integers_gives_the_same_bytes) {
  const Scene scene = soup(64, {.count = 1500, .extent = 80, .size_max = 60});
  Voxelizer one(std::make_unique<GlPipeline>(gpu::test_context(), shared_shaders(),
                                             GlTuning{.int64 = false}));
  for (const Rule rule : {Rule::kTouch, Rule::kThin, Rule::kCenter}) {
    VoxelizeOptions options = unit_cells({80, 80, 80});
    options.color = ColorMode::kNone;
    options.rule = rule;
    const Grid grid = voxelize_on(one, scene, options, PipelineChoice::kRaster);
    EXPECT_TRUE(grid.tiles == voxelize(scene, options, PipelineChoice::kCpu).tiles);
  }
}

TEST(Batches, attributes_without_64_bit_integers_are_refused_and_auto_takes_the_cpu) {
  const Scene scene = soup(66, {.count = 100, .extent = 32, .size_max = 9, .colors = true});
  Voxelizer one(std::make_unique<GlPipeline>(gpu::test_context(), shared_shaders(),
                                             GlTuning{.batches = true, .int64 = false}));
  VoxelizeOptions options = unit_cells({32, 32, 32});
  VoxelizeStats stats;
  const Grid grid = voxelize_on(one, scene, options, PipelineChoice::kAuto, &stats);
  EXPECT_TRUE(grid.channels.color);
  EXPECT_EQ(stats.pipeline, Pipeline::kCpu);
  options.pipeline = PipelineChoice::kCompute;
  const auto refused = one.voxelize(scene, options, {}, nullptr);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kUnsupportedFeature);
  EXPECT_EQ(refused.error().message(),
            "attributes need 64-bit integers in shaders, which " +
                gpu::test_context().info().renderer +
                " does not have: expected pipeline=cpu or auto, or channels=occupancy, got "
                "pipeline compute");
}

TEST(Batches, a_triangle_in_many_tiles_is_whole) {
  MeshPart part;
  add_quad(part, {glm::dvec3(0, 0, 0), {1024, 0, 512}, {1024, 1024, 1024}, {0, 1024, 512}});
  VoxelizeOptions options = unit_cells({1024, 1024, 1024});
  options.color = ColorMode::kNone;
  const Scene scene = scene_of(std::move(part));
  VoxelizeStats stats;
  const Grid grid =
      voxelize_on(batched_voxelizer(), scene, options, PipelineChoice::kCompute, &stats);
  EXPECT_TRUE(grid.tiles == voxelize(scene, options, PipelineChoice::kCpu).tiles);
  // 128 x 128 blocks of 8 x 8 columns, of one triangle or both.
  EXPECT_GE(stats.work_items, 128 * 128);
  EXPECT_LE(stats.work_items, 2 * 128 * 128 + 4 * 4 * 128);
}

TEST(Batches, passes_are_named_and_progress_goes_by_batches) {
  const Scene scene = soup(65, {.count = 300, .extent = 600, .size_max = 100});
  VoxelizeOptions options = unit_cells({600, 600, 600});
  options.color = ColorMode::kNone;
  options.pipeline = PipelineChoice::kCompute;
  Voxelizer one(std::make_unique<GlPipeline>(gpu::test_context(), shared_shaders(),
                                             GlTuning{.batches = true, .batch_tiles = 8}));
  std::vector<int64_t> seen;
  VoxelizeStats stats;
  auto grid = one.voxelize(
      scene, options,
      [&](int64_t done, int64_t total) {
        if (total > 0) seen.push_back(done);
        return true;
      },
      &stats);
  ASSERT_TRUE(grid.ok()) << grid.error().message();
  EXPECT_EQ(seen, (std::vector<int64_t>{0, 8, 16, 24, 27}));
  for (const char* pass : {"classify", "small", "large", "bricks", "gather"}) {
    EXPECT_EQ(std::ranges::count_if(stats.passes, [&](const auto& p) { return p.first == pass; }),
              1)
        << pass;
  }
  EXPECT_LE(stats.device_bytes_peak, one.estimate(scene, options)->device_bytes);
}

}  // namespace
}  // namespace voxeld::pipelines
