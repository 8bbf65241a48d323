// The calls of every pipeline keep OpenGL's rules, also where a job is cancelled or the device runs
// out of memory at any point, and the next job of the same worker then works.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/base/cancel_point.h"
#include "server/render/gl_renderer.h"
#include "tests/gpu/protocol/checked_context.h"
#include "tests/gpu/voxel/pipelines.h"

namespace voxeld::pipelines {
namespace {

using ::testing::IsEmpty;
using ::testing::Not;

constexpr int64_t kPointsMax = 12;  // of one kind, spread over a job

struct Case {
  std::string name;
  PipelineChoice pipeline = PipelineChoice::kCompute;
  bool batches = true;
  Fill fill = Fill::kSurface;
  Sign sign = Sign::kAuto;
  ChannelSet channels = {};
};

std::vector<Case> cases() {
  const ChannelSet attributes{.color = true, .normal = true};
  const ChannelSet ids{.color = true, .label = true, .coverage = true};
  std::vector<Case> all;
  all.push_back({.name = "batches"});
  all.push_back({.name = "batches_attributes", .channels = attributes});
  all.push_back({.name = "words", .batches = false});
  all.push_back({.name = "windows_attributes", .batches = false, .channels = attributes});
  all.push_back({.name = "windows_ids", .batches = false, .channels = ids});
  all.push_back({.name = "raster", .pipeline = PipelineChoice::kRaster});
  all.push_back(
      {.name = "raster_attributes", .pipeline = PipelineChoice::kRaster, .channels = attributes});
  all.push_back({.name = "parity", .fill = Fill::kSolid, .sign = Sign::kParity});
  all.push_back({.name = "nonzero", .fill = Fill::kSolid, .sign = Sign::kNonzero});
  all.push_back({.name = "majority", .fill = Fill::kSolid, .sign = Sign::kMajority});
  all.push_back({.name = "winding", .fill = Fill::kSolid, .sign = Sign::kWinding});
  all.push_back({.name = "flood", .fill = Fill::kSolid, .sign = Sign::kFlood});
  return all;
}

// A closed box across two tiles, and a soup in it: large and small triangles.
Scene sample() {
  Scene scene = soup(91, {.count = 100, .extent = 32, .size_max = 8, .colors = true});
  MeshPart box;
  add_box(box, {2, 2, 2}, {270, 30, 30});
  box.colors.assign(box.positions.size(), {0.2, 0.5, 0.8, 1.0});
  scene.parts.push_back(std::move(box));
  return scene;
}

class Protocol : public ::testing::TestWithParam<Case> {
 protected:
  Protocol() : context_(gpu::test_context()) {
    shaders_ = std::make_unique<gpu::ShaderLibrary>(context_);
    voxelizer_ = std::make_unique<Voxelizer>(
        std::make_unique<GlPipeline>(context_, *shaders_, GlTuning{.batches = GetParam().batches}));
    options_ = unit_cells({272, 32, 32});
    options_.pipeline = GetParam().pipeline;
    options_.fill = GetParam().fill;
    options_.sign = GetParam().sign;
    options_.channels = GetParam().channels;
  }

  Result<Grid> run(const TileProgress& progress = {}) {
    VoxelizeStats stats;
    return voxelizer_->voxelize(scene_, options_, progress, &stats);
  }

  // A job as the one before that was disturbed; the disturbance must have left nothing behind.
  void expect_clean(const std::string& after) {
    EXPECT_THAT(context_.busy(), IsEmpty()) << after;
    EXPECT_THAT(context_.violations(), IsEmpty()) << after;
    context_.fail_no_check();
    const auto grid = run();
    ASSERT_TRUE(grid.ok()) << after << ": " << grid.error().message();
    EXPECT_TRUE(grid->tiles == expected_.tiles) << after;
    EXPECT_THAT(context_.violations(), IsEmpty()) << after;
  }

  // The counts of one warm job, after the first that creates everything.
  gpu::CallCounts warm_up() {
    auto grid = run();
    EXPECT_TRUE(grid.ok()) << grid.error().message();
    if (!grid.ok()) return {};
    expected_ = std::move(grid).value();
    context_.reset_counts();
    expect_clean("a warm job");
    return context_.counts();
  }

  // Calls `disturb` with points from 0 on, at most kPointsMax of `count`.
  static void at_points(int64_t count, const std::function<void(int64_t)>& disturb) {
    const int64_t step = (count + kPointsMax - 1) / kPointsMax;
    for (int64_t point = 0; point < count && !HasFatalFailure(); point += step) disturb(point);
  }

  gpu::CheckedContext context_;
  std::unique_ptr<gpu::ShaderLibrary> shaders_;
  std::unique_ptr<Voxelizer> voxelizer_;
  const Scene scene_ = sample();
  VoxelizeOptions options_;
  Grid expected_;
};

TEST_P(Protocol, a_device_without_memory_at_any_point_fails_one_job_only) {
  const gpu::CallCounts counts = warm_up();
  ASSERT_GT(counts.error_checks, 0);
  at_points(counts.error_checks, [&](int64_t point) {
    const std::string where = "out of memory at check " + std::to_string(point);
    context_.fail_check(point);
    const auto grid = run();
    ASSERT_FALSE(grid.ok()) << where;
    EXPECT_EQ(grid.error().code, ErrorCode::kDeviceUnavailable) << where;
    EXPECT_THAT(grid.error().message(), ::testing::HasSubstr("out of device memory")) << where;
    expect_clean(where);
  });
}

TEST_P(Protocol, a_job_that_is_cancelled_at_any_dispatch_leaves_nothing_active) {
  const gpu::CallCounts counts = warm_up();
  ASSERT_GT(counts.dispatches, 0);
  int cancelled = 0;
  at_points(counts.dispatches, [&](int64_t point) {
    std::atomic<bool> is_cancelled = false;
    context_.cancel_at_dispatch(point, is_cancelled);
    try {
      const CancelScope scope(is_cancelled);
      const auto grid = run([&](int64_t, int64_t) { return !is_cancelled.load(); });
      // Nothing asks any more after the last dispatches.
      EXPECT_TRUE(grid.ok() || grid.error().code == ErrorCode::kCancelled);
      cancelled += grid.ok() ? 0 : 1;
    } catch (const Cancelled&) {
      ++cancelled;
    }
    EXPECT_TRUE(is_cancelled.load());
    expect_clean("cancelled at dispatch " + std::to_string(point));
  });
  EXPECT_GT(cancelled, 0);
}

TEST_P(Protocol, a_job_that_is_cancelled_at_any_progress_leaves_nothing_active) {
  warm_up();
  int64_t calls = 0;
  ASSERT_TRUE(run([&](int64_t, int64_t) { return ++calls > 0; }).ok());
  ASSERT_GT(calls, 1);
  at_points(calls, [&](int64_t point) {
    int64_t call = 0;
    const auto grid = run([&](int64_t, int64_t) { return call++ != point; });
    ASSERT_FALSE(grid.ok()) << point;
    EXPECT_EQ(grid.error().code, ErrorCode::kCancelled);
    expect_clean("cancelled at progress " + std::to_string(point));
  });
}

TEST_P(Protocol, every_object_is_deleted_in_the_end) {
  warm_up();
  EXPECT_THAT(context_.existing(), Not(IsEmpty()));
  voxelizer_.reset();
  shaders_.reset();
  EXPECT_THAT(context_.existing(), IsEmpty());
  EXPECT_THAT(context_.violations(), IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(Pipelines, Protocol, ::testing::ValuesIn(cases()),
                         [](const auto& one) { return one.param.name; });

// pipeline=auto: the CPU goes on where the device fails, and makes the same bytes.
TEST_P(Protocol, a_job_of_auto_goes_on_on_the_cpu) {
  const gpu::CallCounts counts = warm_up();
  if (GetParam().pipeline == PipelineChoice::kRaster) return;  // auto takes compute on hardware
  ASSERT_GT(counts.error_checks, 0);
  options_.pipeline = PipelineChoice::kAuto;
  at_points(counts.error_checks, [&](int64_t point) {
    context_.fail_check(point);
    VoxelizeStats stats;
    const auto grid = voxelizer_->voxelize(scene_, options_, {}, &stats);
    context_.fail_no_check();
    ASSERT_TRUE(grid.ok()) << point << ": " << grid.error().message();
    EXPECT_TRUE(grid->tiles == expected_.tiles) << point;
    EXPECT_EQ(stats.pipeline, Pipeline::kCpu);
    EXPECT_THAT(stats.device_failure, ::testing::HasSubstr("out of device memory"));
    EXPECT_EQ(stats.pipeline_reason, "cpu: compute failed on the device: " + stats.device_failure);
    EXPECT_EQ(stats.tiles, 2);
    EXPECT_THAT(context_.violations(), IsEmpty()) << point;
  });
}

// A device without 64-bit integers in shaders.
TEST_P(Protocol, a_device_without_64_bit_integers_makes_the_same_grids) {
  warm_up();
  voxelizer_.reset();
  shaders_.reset();
  context_.take_int64_away();
  shaders_ = std::make_unique<gpu::ShaderLibrary>(context_);
  voxelizer_ = std::make_unique<Voxelizer>(
      std::make_unique<GlPipeline>(context_, *shaders_, GlTuning{.batches = GetParam().batches}));
  options_.pipeline = PipelineChoice::kAuto;
  VoxelizeStats stats;
  const auto grid = voxelizer_->voxelize(scene_, options_, {}, &stats);
  ASSERT_TRUE(grid.ok()) << grid.error().message();
  EXPECT_TRUE(grid->tiles == expected_.tiles);
  EXPECT_EQ(stats.device_failure, "");
  EXPECT_EQ(stats.pipeline, GetParam().channels.any() ? Pipeline::kCpu : Pipeline::kCompute);
}

TEST(RendererProtocol, a_grid_that_does_not_fit_leaves_none_of_its_tables_on_the_device) {
  gpu::CheckedContext context(gpu::test_context());
  gpu::ShaderLibrary shaders(context);
  GlRenderer renderer(context, shaders);
  const std::vector<std::string> before = context.existing();
  Grid grid;
  grid.spec.dims = {8, 8, 8};
  context.reset_counts();
  ASSERT_TRUE(renderer.set_grid(grid).ok());
  const int64_t checks = context.counts().error_checks;
  ASSERT_GT(checks, 0);
  for (int64_t check = 0; check < checks; ++check) {
    context.fail_check(check);
    EXPECT_FALSE(renderer.set_grid(grid).ok()) << check;
    EXPECT_EQ(context.existing(), before) << check;
  }
  context.fail_no_check();
  EXPECT_TRUE(renderer.set_grid(grid).ok());
  EXPECT_THAT(context.violations(), IsEmpty());
}

// The checks themselves: each broken rule is found.
TEST(CheckedContext, broken_rules_are_found) {
  gpu::CheckedContext context(gpu::test_context());
  const gpu::GlApi& gl = context.gl();
  GLuint queries[2] = {};
  gl.CreateQueries(GL_TIME_ELAPSED, 2, queries);
  gl.BeginQuery(GL_TIME_ELAPSED, queries[0]);
  EXPECT_THAT(context.violations(), IsEmpty());
  EXPECT_EQ(context.busy().size(), 1u);
  // The driver must not see these: they are errors there.
  const size_t before = context.violations().size();
  gl.DeleteQueries(1, &queries[0]);
  ASSERT_EQ(context.violations().size(), before + 1);
  EXPECT_THAT(context.violations().back(), ::testing::HasSubstr("is active"));
  gl.DeleteQueries(1, &queries[0]);
  EXPECT_THAT(context.violations().back(), ::testing::HasSubstr("does not exist"));
  gl.DeleteQueries(1, &queries[1]);

  GLuint buffer = 0;
  gl.CreateBuffers(1, &buffer);
  gl.NamedBufferStorage(buffer, 16, nullptr,
                        GL_DYNAMIC_STORAGE_BIT | GL_MAP_READ_BIT | GL_MAP_WRITE_BIT);
  ASSERT_NE(gl.MapNamedBufferRange(buffer, 0, 16, GL_MAP_READ_BIT), nullptr);
  uint32_t word = 0;
  gl.GetNamedBufferSubData(buffer, 0, 4, &word);
  EXPECT_THAT(context.violations().back(), ::testing::HasSubstr("is mapped"));
  EXPECT_EQ(gl.UnmapNamedBuffer(buffer), GL_TRUE);
  gl.DeleteBuffers(1, &buffer);
  gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, buffer);
  EXPECT_THAT(context.violations().back(), ::testing::HasSubstr("does not exist"));
  EXPECT_THAT(context.existing(), IsEmpty());
  while (gpu::test_context().gl().GetError() != GL_NO_ERROR) {
  }
}

}  // namespace
}  // namespace voxeld::pipelines
