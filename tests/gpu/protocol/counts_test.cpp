// Dispatches, waits and bytes that a warm job asks of the device. The limits are what the passes
// need now, so that a change that makes a device wait more often is seen; one that needs less
// lowers them. The table is in tests/bench/README.md, too.
#include <gtest/gtest.h>

#include <cstdint>
#include <cstdio>
#include <memory>
#include <ostream>
#include <string>

#include "tests/bench/waves.h"
#include "tests/gpu/protocol/checked_context.h"
#include "tests/gpu/voxel/pipelines.h"

namespace voxeld::pipelines {
namespace {

struct Limits {
  int64_t dispatches = 0;
  int64_t blocking_reads = 0;
  int64_t uploads = 0;
  int64_t kib_down = 0;
  int64_t kib_up = 0;
};

struct Job {
  std::string name;
  int size = 256;
  PipelineChoice pipeline = PipelineChoice::kCompute;
  Fill fill = Fill::kSurface;
  Sign sign = Sign::kAuto;
  ChannelSet channels = {};
  Limits limits;
};

void PrintTo(const Job& job, std::ostream* out) {
  *out << job.name << " at " << job.size;
}

class Counts : public ::testing::TestWithParam<Job> {};

TEST_P(Counts, of_a_warm_job_are_at_most_the_limits) {
  const Job& job = GetParam();
  const Scene scene = wavy_sphere(5);  // 20,480 triangles, closed
  gpu::CheckedContext context(gpu::test_context());
  gpu::ShaderLibrary shaders(context);
  Voxelizer voxelizer(std::make_unique<GlPipeline>(context, shaders, GlTuning{.batches = true}));
  VoxelizeOptions options;
  options.placement.size = job.size;
  options.pipeline = job.pipeline;
  options.fill = job.fill;
  options.sign = job.sign;
  options.channels = job.channels;
  for (int run = 0; run < 2; ++run) {  // the first creates programs and buffers
    context.reset_counts();
    VoxelizeStats stats;
    const auto grid = voxelizer.voxelize(scene, options, {}, &stats);
    ASSERT_TRUE(grid.ok()) << grid.error().message();
    EXPECT_EQ(stats.device_failure, "");
  }
  const gpu::CallCounts& counts = context.counts();
  const auto kib = [](int64_t bytes) { return (bytes + 1023) / 1024; };
  std::printf("| %s | %d | %lld | %lld | %lld | %lld | %lld |\n", job.name.c_str(), job.size,
              static_cast<long long>(counts.dispatches),
              static_cast<long long>(counts.blocking_reads), static_cast<long long>(counts.uploads),
              static_cast<long long>(kib(counts.bytes_down)),
              static_cast<long long>(kib(counts.bytes_up)));
  EXPECT_GT(counts.dispatches, 0);  // the device, and not the CPU, has done it
  EXPECT_LE(counts.dispatches, job.limits.dispatches);
  EXPECT_LE(counts.blocking_reads, job.limits.blocking_reads);
  EXPECT_LE(counts.uploads, job.limits.uploads);
  EXPECT_LE(kib(counts.bytes_down), job.limits.kib_down);
  EXPECT_LE(kib(counts.bytes_up), job.limits.kib_up);
}

const ChannelSet kColorAndNormal{.color = true, .normal = true};

INSTANTIATE_TEST_SUITE_P(
    Jobs, Counts,
    ::testing::Values(Job{.name = "compute", .size = 256, .limits = {6, 4, 9, 279, 525}},
                      Job{.name = "compute", .size = 512, .limits = {6, 4, 16, 1126, 530}},
                      Job{.name = "compute_attributes",
                          .size = 256,
                          .channels = kColorAndNormal,
                          .limits = {8, 6, 21, 4534, 5452}},
                      Job{.name = "raster",
                          .size = 256,
                          .pipeline = PipelineChoice::kRaster,
                          .limits = {1, 7, 2, 1824, 721}},
                      Job{.name = "raster_attributes",
                          .size = 256,
                          .pipeline = PipelineChoice::kRaster,
                          .channels = kColorAndNormal,
                          .limits = {2, 9, 11, 6079, 4545}},
                      Job{.name = "parity",
                          .size = 256,
                          .fill = Fill::kSolid,
                          .sign = Sign::kParity,
                          .limits = {9, 13, 14, 2072, 1439}},
                      Job{.name = "flood",
                          .size = 256,
                          .fill = Fill::kSolid,
                          .sign = Sign::kFlood,
                          .limits = {12, 7, 16, 2159, 2405}}),
    [](const auto& one) { return one.param.name + "_" + std::to_string(one.param.size); });

}  // namespace
}  // namespace voxeld::pipelines
