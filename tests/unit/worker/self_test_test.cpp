// The self-test on made-up devices, each of which differs in one way.
#include "server/worker/device/self_test.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/render/cpu/cpu_renderer.h"
#include "server/voxel/cpu/cpu_pipeline.h"

namespace voxeld {
namespace {

using ::testing::HasSubstr;

// A device that makes the CPU's tiles, changed by `change` if that is set.
class FakeDevice final : public TilePipeline {
 public:
  using Change = std::function<Status(const VoxelizePlan&, Pipeline, std::vector<SparseTile>&)>;
  explicit FakeDevice(Change change) : change_(std::move(change)) {}

  Status begin_job(const VoxelizePlan& plan, VoxelizeStats& stats) override {
    plan_ = &plan;
    pipeline_ = stats.pipeline;
    return cpu_.begin_job(plan, stats);
  }
  Status run_tiles(std::span<const TileBin> bins, const Pause& pause,
                   std::vector<SparseTile>& tiles) override {
    VOXELD_TRY(cpu_.run_tiles(bins, pause, tiles));
    return change_ ? change_(*plan_, pipeline_, tiles) : Status();
  }
  void end_job() override { cpu_.end_job(); }
  int64_t device_bytes(const Scene&, const WantedChannels&) const override { return 0; }
  DeviceTraits traits() const override { return {.is_software = false}; }

 private:
  Change change_;
  CpuPipeline cpu_{1};
  const VoxelizePlan* plan_ = nullptr;
  Pipeline pipeline_ = Pipeline::kCpu;
};

// Draws as the CPU does, but for `add` that is added to red.
class FakeRenderer final : public Renderer {
 public:
  explicit FakeRenderer(uint8_t add) : add_(add) {}
  Status set_grid(const Grid& grid) override { return cpu_.set_grid(grid); }
  Result<RenderImage> render(const RenderOptions& options, const BlockProgress& progress) override {
    VOXELD_ASSIGN(RenderImage image, cpu_.render(options, progress));
    for (size_t i = 0; i < image.rgba.size(); i += 4) {
      image.rgba[i] = static_cast<uint8_t>(std::min(255, image.rgba[i] + add_));
    }
    return image;
  }
  void set_quality(const RenderQuality& quality) override { cpu_.set_quality(quality); }
  Result<std::vector<Hit>> render_hits(const RenderOptions& options) override {
    return cpu_.render_hits(options);
  }

 private:
  CpuRenderer cpu_;
  uint8_t add_;
};

DeviceFaults faults_of(FakeDevice::Change change, const DeviceFaults& known = {},
                       std::vector<std::string>* steps = nullptr, bool is_brief = false) {
  Voxelizer voxelizer(std::make_unique<FakeDevice>(std::move(change)), 1);
  CpuRenderer cpu;
  return self_test(
      {voxelizer, nullptr, cpu, is_brief}, known, [&](DevicePart part, std::string_view step) {
        if (steps == nullptr) return;
        steps->push_back(std::string(device_part_name(part)) + ": " + std::string(step));
      });
}

TEST(SelfTest, a_device_that_makes_the_cpus_bytes_has_no_faults_and_ran_every_step) {
  std::vector<std::string> steps;
  EXPECT_EQ(faults_of({}, {}, &steps).text(), "");
  EXPECT_EQ(steps.size(), 2u * (3 + 13) + 5);
  EXPECT_EQ(steps.front(), "compute: touch");
  EXPECT_EQ(steps.back(), "solid: winding");
}

TEST(SelfTest, a_brief_test_runs_every_part) {
  std::vector<std::string> steps;
  EXPECT_EQ(faults_of({}, {}, &steps, true).text(), "");
  EXPECT_EQ(steps.size(), 2u * (3 + 7) + 5);
}

TEST(SelfTest, voxels_that_one_rule_of_one_pipeline_loses_are_its_fault_alone) {
  const auto faults = faults_of(
      [](const VoxelizePlan& plan, Pipeline pipeline, std::vector<SparseTile>& tiles) -> Status {
        const bool loses = pipeline == Pipeline::kRaster && plan.options.rule == Rule::kThin;
        if (loses && !tiles.empty()) tiles.pop_back();
        return {};
      });
  EXPECT_THAT(faults.why(DevicePart::kRaster),
              ::testing::MatchesRegex("thin: [0-9]+ voxels, [0-9]+ on the CPU"));
  EXPECT_EQ(faults.text(), "raster: " + faults.why(DevicePart::kRaster));
}

TEST(SelfTest, a_wrong_value_is_a_fault_of_the_attributes) {
  const auto faults = faults_of(
      [](const VoxelizePlan& plan, Pipeline pipeline, std::vector<SparseTile>& tiles) -> Status {
        if (pipeline != Pipeline::kCompute || !plan.channels.grid.normal) return {};
        for (SparseTile& tile : tiles) {
          if (!tile.normal.empty()) tile.normal[0] = static_cast<int8_t>(tile.normal[0] ^ 1);
        }
        return {};
      });
  EXPECT_EQ(faults.why(DevicePart::kComputeAttributes),
            "colors and normals of an opaque mesh: other values than the CPU's");
  EXPECT_FALSE(faults.has(DevicePart::kCompute));
  EXPECT_FALSE(faults.has(DevicePart::kRasterAttributes));
}

TEST(SelfTest, an_error_is_a_fault_with_its_words) {
  const auto faults =
      faults_of([](const VoxelizePlan&, Pipeline, std::vector<SparseTile>&) -> Status {
        return Error{ErrorCode::kInternal, "batch_touch.comp does not compile", "", ""};
      });
  EXPECT_EQ(faults.why(DevicePart::kCompute), "touch: batch_touch.comp does not compile");
  EXPECT_EQ(faults.why(DevicePart::kSolid), "no pipeline of the device makes its surface");
  EXPECT_EQ(
      faults.text(),
      "compute, raster: touch: batch_touch.comp does not compile; compute-attributes, "
      "raster-attributes: colors of an opaque mesh: batch_touch.comp does not compile; solid: "
      "no pipeline of the device makes its surface");
}

TEST(SelfTest, parts_with_known_faults_are_not_run) {
  DeviceFaults known;
  known.add(DevicePart::kCompute, "the driver crashed");
  std::vector<std::string> steps;
  const DeviceFaults faults = faults_of({}, known, &steps);
  EXPECT_EQ(faults.text(), "compute: the driver crashed");
  EXPECT_EQ(steps.front(), "compute-attributes: colors of an opaque mesh");
  EXPECT_EQ(steps.back(), "solid: winding");  // on a surface of pipeline raster
}

TEST(SelfTest, images_may_differ_by_rounding_but_not_in_colour) {
  const auto images = [](uint8_t add) {
    Voxelizer voxelizer(std::make_unique<FakeDevice>(FakeDevice::Change()), 1);
    FakeRenderer gl(add);
    CpuRenderer cpu;
    DeviceFaults known;
    for (const DevicePart part : {DevicePart::kCompute, DevicePart::kComputeAttributes,
                                  DevicePart::kRaster, DevicePart::kRasterAttributes}) {
      known.add(part, "left out");
    }
    return self_test({voxelizer, &gl, cpu, false}, known, [](DevicePart, std::string_view) {});
  };
  EXPECT_FALSE(images(1).has(DevicePart::kImages));
  EXPECT_THAT(images(9).why(DevicePart::kImages),
              HasSubstr("pixels have other colours than the CPU's"));
}

TEST(DeviceFaults, parts_have_names_and_keep_their_first_fault) {
  for (size_t i = 0; i < kDevicePartCount; ++i) {
    const auto part = static_cast<DevicePart>(i);
    EXPECT_EQ(device_part_from(device_part_name(part)), part);
  }
  EXPECT_EQ(device_part_from("none"), std::nullopt);
  DeviceFaults faults;
  EXPECT_FALSE(faults.any());
  faults.add(DevicePart::kSolid, "first");
  faults.add(DevicePart::kSolid, "second");
  EXPECT_EQ(faults.text(), "solid: first");
  EXPECT_EQ(all_faulty("new driver").text(),
            "compute, compute-attributes, raster, raster-attributes, solid, images: new driver");
}

}  // namespace
}  // namespace voxeld
