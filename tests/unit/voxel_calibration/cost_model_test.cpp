// Fitting and predicting against costs that are known.
#include "server/voxel/estimates/cost_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace voxeld {
namespace {

double known_cost(const CostModel& model, const Workload& work) {
  return model.job_ms + model.tile_ms * work.tiles +
         (model.triangle_ns * work.triangles + model.column_ns * work.columns) / 1e6;
}

// Each term is the largest of some.
std::vector<Workload> workloads() {
  return {{1, 10, 20},      {8, 20, 40},       {1, 1e5, 1.2e5}, {1, 100, 1e6},
          {64, 1000, 2000}, {512, 2e6, 1.9e7}, {2, 3e4, 3e4},   {1, 1, 4e6}};
}

std::vector<CostSample> samples_of(const CostModel& model) {
  std::vector<CostSample> samples;
  for (const Workload& work : workloads()) samples.push_back({work, known_cost(model, work)});
  return samples;
}

TEST(CostModel, a_fit_gives_back_the_costs_that_made_the_samples) {
  const CostModel known{0.4, 0.05, 60, 3.5};
  const auto fitted = fit_cost_model(samples_of(known));
  ASSERT_TRUE(fitted.ok()) << fitted.error().message();
  EXPECT_NEAR(fitted->job_ms, 0.4, 1e-6);
  EXPECT_NEAR(fitted->tile_ms, 0.05, 1e-6);
  EXPECT_NEAR(fitted->triangle_ns, 60, 1e-4);
  EXPECT_NEAR(fitted->column_ns, 3.5, 1e-5);
  EXPECT_LT(fitted->error, 1e-9);
}

TEST(CostModel, terms_that_cost_nothing_are_zero_and_never_less) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> noise(0.7, 1.4);
  std::vector<CostSample> samples = samples_of({0, 0, 500, 0});
  for (CostSample& sample : samples) sample.ms *= noise(random);
  const auto fitted = fit_cost_model(samples);
  ASSERT_TRUE(fitted.ok());
  for (const double term :
       {fitted->job_ms, fitted->tile_ms, fitted->triangle_ns, fitted->column_ns}) {
    EXPECT_GE(term, 0);
  }
  EXPECT_NEAR(fitted->triangle_ns, 500, 250);
  EXPECT_GT(fitted->error, 0.01);
  EXPECT_LT(fitted->error, 0.5);
}

TEST(CostModel, larger_requests_are_never_predicted_to_cost_less) {
  const auto fitted = fit_cost_model(samples_of({1, 0.1, 10, 1}));
  ASSERT_TRUE(fitted.ok());
  const Workload one{3, 1000, 5000};
  const double ms = fitted->predict_ms(one);
  EXPECT_GE(fitted->predict_ms({30, 1000, 5000}), ms);
  EXPECT_GE(fitted->predict_ms({3, 9000, 5000}), ms);
  EXPECT_GE(fitted->predict_ms({3, 1000, 50000}), ms);
}

TEST(CostModel, too_few_or_impossible_measurements_are_refused) {
  std::vector<CostSample> samples = samples_of({1, 1, 1, 1});
  samples.resize(3);
  EXPECT_EQ(fit_cost_model(samples).error().message(),
            "too few measurements for a cost model: expected at least 4, got 3");
  samples = samples_of({1, 1, 1, 1});
  for (const double bad : {0.0, -1.0, std::nan(""), HUGE_VAL}) {
    samples[2].ms = bad;
    EXPECT_FALSE(fit_cost_model(samples).ok()) << bad;
  }
}

TEST(Workload, counts_the_columns_that_triangles_cover) {
  SnappedMesh mesh;
  const int unit = 1 << limits::kSubVoxelBits;
  mesh.vertices = {{0, 0, 0}, {9 * unit, 0, 0}, {0, 4 * unit, 0}, {unit / 2, unit / 2, 0}};
  // 10 x 5 columns, and 1.5 x 1.5.
  mesh.triangles.resize(2);
  mesh.triangles[0].vertices = {0, 1, 2};
  mesh.triangles[1].vertices = {0, 3, 0};
  const std::vector<uint32_t> numbers = {0, 1};
  const std::vector<TileBin> bins = {{{0, 0, 0}, numbers}, {{1, 0, 0}, {numbers.data(), 1}}};
  const Workload work = estimate_workload(mesh, bins);
  EXPECT_EQ(work.tiles, 2);
  EXPECT_EQ(work.triangles, 3);
  EXPECT_DOUBLE_EQ(work.columns, 50 + 2.25);
}

TEST(Workload, many_triangles_are_estimated_from_a_sample) {
  SnappedMesh mesh;
  const int unit = 1 << limits::kSubVoxelBits;
  mesh.vertices = {{0, 0, 0}, {unit, 0, 0}, {0, unit, 0}};
  SnappedTriangle triangle;
  triangle.vertices = {0, 1, 2};
  mesh.triangles.assign(100'003, triangle);
  EXPECT_NEAR(estimate_workload(mesh, {}).columns, 4.0 * 100'003, 1);
  EXPECT_EQ(estimate_workload(SnappedMesh{}, {}).columns, 0);
}

}  // namespace
}  // namespace voxeld
