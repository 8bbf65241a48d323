// The pipeline that `auto` chooses, and the reason that it gives.
#include "server/voxel/pipelines/choose.h"

#include <gtest/gtest.h>

namespace voxeld {
namespace {

const DeviceTraits kSoftware{true, 0};
const DeviceTraits kHardware{false, 0};
const Workload kWork{1, 1000, 1e6};

// cpu: 8.1 ms of columns; compute: 20 ms to start with; raster: 98 ms for a tile.
CalibrationLookup calibrated() {
  CalibrationLookup lookup;
  lookup.found = true;
  lookup.calibration.date = "2026-11-21";
  lookup.calibration.pipelines = {
      {Pipeline::kCpu, {0, 0, 0, 8.1, 0}, {0, 0, 0, 810, 0}},
      {Pipeline::kCompute, {20, 0, 0, 3, 0}, {20, 0, 0, 30, 0}},
      {Pipeline::kRaster, {0, 98, 0, 0, 0}, {0, 980, 0, 0, 0}},
  };
  return lookup;
}

TEST(ChoosePipeline, takes_the_least_predicted_time_and_names_all) {
  const CalibrationLookup lookup = calibrated();
  const auto decision = decide_pipeline(PipelineChoice::kAuto, {&kHardware, lookup}, kWork, false);
  EXPECT_EQ(decision.pipeline, Pipeline::kCpu);
  EXPECT_EQ(decision.reason,
            "cpu: predicted 8.1 ms, compute 23 ms, raster 98 ms (calibrated 2026-11-21)");
  EXPECT_DOUBLE_EQ(decision.predicted_ms.value(), 8.1);
}

TEST(ChoosePipeline, decides_by_the_size_and_the_channels_of_the_request) {
  const CalibrationLookup lookup = calibrated();
  const ChoiceContext context{&kSoftware, lookup};
  const auto choice = [&](const Workload& work, bool attributes) {
    return decide_pipeline(PipelineChoice::kAuto, context, work, attributes).pipeline;
  };
  EXPECT_EQ(choice({1, 1, 1e4}, false), Pipeline::kCpu);
  EXPECT_EQ(choice({1, 1, 8e6}, false), Pipeline::kCompute);
  EXPECT_EQ(choice({1, 1, 4e7}, false), Pipeline::kRaster);
  EXPECT_EQ(choice({1, 1, 1e6}, true), Pipeline::kCompute);
}

TEST(ChoosePipeline, faulty_pipelines_are_left_out_with_and_without_a_calibration) {
  const CalibrationLookup lookup = calibrated(), none;
  DeviceFaults faults;
  const auto decide = [&](const CalibrationLookup& by, bool attributes) {
    return decide_pipeline(PipelineChoice::kAuto, {&kHardware, by, &faults}, {1, 1, 8e6},
                           attributes);
  };
  EXPECT_EQ(decide(none, false).pipeline, Pipeline::kCompute);
  faults.add(DevicePart::kCompute, "touch: 3 voxels, 4 on the CPU");
  EXPECT_EQ(decide(none, false).pipeline, Pipeline::kRaster);
  EXPECT_EQ(decide(none, false).reason,
            "raster: the device is hardware; the device failed the self-test of compute");
  EXPECT_EQ(decide(none, true).pipeline, Pipeline::kCompute);
  EXPECT_EQ(decide(lookup, false).reason,
            "cpu: predicted 65 ms, raster 98 ms (calibrated 2026-11-21); the device failed the "
            "self-test of compute");
  faults.add(DevicePart::kRaster, "touch: the driver crashed");
  EXPECT_EQ(decide(none, false).pipeline, Pipeline::kCpu);
  EXPECT_EQ(decide(none, false).reason,
            "cpu: it makes the bytes that the device should; the device failed the self-test of "
            "compute and raster");
}

TEST(ChoosePipeline, a_device_without_gl_has_pipeline_cpu_alone) {
  const CalibrationLookup lookup = calibrated();
  const auto decision =
      decide_pipeline(PipelineChoice::kAuto, {nullptr, lookup}, {1, 1, 4e7}, false);
  EXPECT_EQ(decision.pipeline, Pipeline::kCpu);
  EXPECT_EQ(decision.reason, "cpu: predicted 320 ms (calibrated 2026-11-21)");
  const CalibrationLookup none;
  EXPECT_EQ(decide_pipeline(PipelineChoice::kAuto, {nullptr, none}, kWork, false).reason,
            "cpu: there is no GL context");
}

TEST(ChoosePipeline, attributes_on_a_device_without_64_bit_integers_take_the_cpu) {
  const DeviceTraits device{false, 0, false};
  const CalibrationLookup none, lookup = calibrated();
  const auto choice = [&](const CalibrationLookup& found, bool attributes) {
    return decide_pipeline(PipelineChoice::kAuto, {&device, found}, {1, 1, 4e7}, attributes);
  };
  EXPECT_EQ(choice(lookup, true).pipeline, Pipeline::kCpu);
  EXPECT_EQ(choice(lookup, false).pipeline, Pipeline::kRaster);
  EXPECT_EQ(choice(none, false).pipeline, Pipeline::kCompute);
  EXPECT_EQ(choice(none, true).pipeline, Pipeline::kCpu);
  EXPECT_EQ(choice(none, true).reason,
            "cpu: attributes need 64-bit integers in shaders, which the device does not have");
}

TEST(ChoosePipeline, without_measurements_the_rule_applies_and_the_reason_says_how_to_get_them) {
  CalibrationLookup lookup;
  lookup.why_not = "calibrated for 4 threads";
  const auto software = decide_pipeline(PipelineChoice::kAuto, {&kSoftware, lookup}, kWork, false);
  EXPECT_EQ(software.pipeline, Pipeline::kCpu);
  EXPECT_EQ(software.reason,
            "cpu: the device is a software driver, which would run shaders on the same cores "
            "(calibrated for 4 threads: `voxeld doctor --calibrate` measures)");
  EXPECT_FALSE(software.predicted_ms.has_value());
  const auto hardware = decide_pipeline(PipelineChoice::kAuto, {&kHardware, lookup}, kWork, false);
  EXPECT_EQ(hardware.pipeline, Pipeline::kCompute);
}

TEST(ChoosePipeline, a_requested_pipeline_is_taken_whatever_its_cost) {
  const CalibrationLookup lookup = calibrated();
  const auto decision =
      decide_pipeline(PipelineChoice::kRaster, {&kHardware, lookup}, kWork, false);
  EXPECT_EQ(decision.pipeline, Pipeline::kRaster);
  EXPECT_EQ(decision.reason, "asked for");
  EXPECT_DOUBLE_EQ(decision.predicted_ms.value(), 98);
}

TEST(ChoosePipeline, times_are_written_with_two_digits) {
  EXPECT_EQ(milliseconds_text(0.0123), "0.012 ms");
  EXPECT_EQ(milliseconds_text(8.14), "8.1 ms");
  EXPECT_EQ(milliseconds_text(98.4), "98 ms");
  EXPECT_EQ(milliseconds_text(1234), "1200 ms");
}

}  // namespace
}  // namespace voxeld
