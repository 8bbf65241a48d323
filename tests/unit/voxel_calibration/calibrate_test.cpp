// Measuring pipeline cpu, which every machine has.
#include "server/voxel/calibrate.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace voxeld {
namespace {

TEST(CalibrationScene, has_the_triangles_and_the_edges_of_its_case_inside_the_grid) {
  ASSERT_FALSE(calibration_cases().empty());
  for (const CalibrationCase& one : calibration_cases()) {
    SCOPED_TRACE(std::to_string(one.size) + " cells, edges of " + std::to_string(one.edge));
    const Scene scene = calibration_scene(one, false);
    EXPECT_NEAR(static_cast<double>(scene.triangle_count()), one.triangle_count, 1);
    const Box3d box = scene.bounds();
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_GE(box.min[axis], 0);
      EXPECT_LE(box.max[axis], one.size);
    }
    const auto& p = scene.parts[0].positions;
    EXPECT_NEAR(p[1].x - p[0].x, one.edge, 1e-9);
    EXPECT_EQ(calibration_scene(one, false).parts[0].indices, scene.parts[0].indices);
    EXPECT_TRUE(calibration_scene(one, true).has_colors());
  }
}

TEST(Calibrate, measures_every_case_that_time_allows_and_fits_a_model_to_it) {
  Voxelizer voxelizer(nullptr, 2);
  const auto measured = measure_pipelines(voxelizer, {Pipeline::kCpu}, 0.0);
  ASSERT_TRUE(measured.ok()) << measured.error().message();
  // No time: the six cases without which there is no model, for either kind of grid.
  EXPECT_EQ(measured->size(), 12u);
  for (const CalibrationMeasurement& one : *measured) {
    EXPECT_EQ(one.pipeline, Pipeline::kCpu);
    EXPECT_GT(one.sample.ms, 0);
    EXPECT_GE(one.sample.work.triangles, one.made_from.triangle_count - 2);
    EXPECT_GE(one.sample.work.columns, one.sample.work.triangles);
    EXPECT_GE(one.sample.work.tiles, 1);
  }
  const auto fitted = fit_pipelines(*measured);
  ASSERT_TRUE(fitted.ok()) << fitted.error().message();
  ASSERT_EQ(fitted->size(), 1u);
  const CostModel& model = fitted->front().occupancy;
  EXPECT_GT(model.predict_ms({8, 1e6, 1e7}), model.predict_ms({1, 100, 1000}));
}

TEST(Calibrate, a_pipeline_that_the_device_does_not_have_is_an_error) {
  Voxelizer voxelizer(nullptr, 1);
  const auto measured = measure_pipelines(voxelizer, {Pipeline::kCompute}, 0.0);
  ASSERT_FALSE(measured.ok());
  EXPECT_EQ(measured.error().code, ErrorCode::kUnsupportedFeature);
}

TEST(Calibrate, a_voxelizer_reports_the_numbers_of_its_decision) {
  CalibrationLookup lookup;
  lookup.found = true;
  lookup.calibration.date = "2026-11-21";
  lookup.calibration.pipelines = {{Pipeline::kCpu, {1.5, 0, 0, 0, 0}, {2.5, 0, 0, 0, 0}}};
  Voxelizer voxelizer(nullptr, 1);
  voxelizer.set_calibration(lookup);
  const Scene scene = calibration_scene({64, 4, 200}, false);
  VoxelizeStats stats;
  ASSERT_TRUE(voxelizer.voxelize(scene, {}, {}, &stats).ok());
  EXPECT_EQ(stats.pipeline_reason, "cpu: predicted 1.5 ms (calibrated 2026-11-21)");
  const auto estimate = voxelizer.estimate(scene, {});
  ASSERT_TRUE(estimate.ok());
  EXPECT_DOUBLE_EQ(estimate->pipeline.predicted_ms.value(), 1.5);
}

}  // namespace
}  // namespace voxeld
