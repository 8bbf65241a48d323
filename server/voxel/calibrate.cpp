#include "server/voxel/calibrate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "server/base/clock.h"
#include "server/voxel/triangles/snap.h"

namespace voxeld {
namespace {

constexpr size_t kRuns = 3;
// Runs that take longer are not repeated, because disturbances are small beside them.
constexpr double kLongRunMs = 150;
// Cases that are measured however long they take, because fewer give no model.
constexpr size_t kCasesMin = 6;

constexpr std::array<std::string_view, 4> kShared = {"place", "snap", "levels", "bin"};

VoxelizeOptions options_of(const CalibrationCase& one, Pipeline pipeline, bool attributes) {
  VoxelizeOptions options;
  const double side = one.size;
  options.placement.dims = {one.size, one.size, one.size};
  options.placement.bounds = {0, 0, 0, side, side, side};
  options.color = attributes ? ColorMode::kAverage : ColorMode::kNone;
  switch (pipeline) {
    case Pipeline::kRaster:
      options.pipeline = PipelineChoice::kRaster;
      break;
    case Pipeline::kCompute:
      options.pipeline = PipelineChoice::kCompute;
      break;
    case Pipeline::kCpu:
      options.pipeline = PipelineChoice::kCpu;
      break;
  }
  return options;
}

// Runs once and returns the time without the passes that all pipelines share.
Result<CostSample> run_once(Voxelizer& voxelizer, const Scene& scene,
                            const VoxelizeOptions& options) {
  VoxelizeStats stats;
  const Stopwatch watch;
  VOXELD_ASSIGN(const Grid grid, voxelizer.voxelize(scene, options, {}, &stats));
  double ms = watch.ms();
  for (const auto& [pass, pass_ms] : stats.passes) {
    if (std::find(kShared.begin(), kShared.end(), pass) != kShared.end()) ms -= pass_ms;
  }
  return CostSample{stats.work, std::max(ms, 1e-4)};
}

Result<CostSample> median_run(Voxelizer& voxelizer, const Scene& scene,
                              const VoxelizeOptions& options) {
  std::vector<CostSample> runs;
  while (runs.size() < kRuns) {
    VOXELD_ASSIGN(const CostSample run, run_once(voxelizer, scene, options));
    runs.push_back(run);
    if (run.ms > kLongRunMs) break;
  }
  const auto middle = runs.begin() + static_cast<std::ptrdiff_t>(runs.size() / 2);
  std::nth_element(runs.begin(), middle, runs.end(),
                   [](const CostSample& a, const CostSample& b) { return a.ms < b.ms; });
  return *middle;
}

Status measure(Voxelizer& voxelizer, Pipeline pipeline, bool attributes, double seconds_max,
               std::vector<CalibrationMeasurement>& measurements) {
  // A warm-up run, which compiles programs and allocates buffers.
  const CalibrationCase& first = calibration_cases().front();
  VOXELD_TRY(run_once(voxelizer, calibration_scene(first, attributes),
                      options_of(first, pipeline, attributes)));
  const Stopwatch watch;
  size_t count = 0;
  for (const CalibrationCase& one : calibration_cases()) {
    if (count++ >= kCasesMin && watch.ms() > 1e3 * seconds_max) break;
    VOXELD_ASSIGN(const CostSample sample, median_run(voxelizer, calibration_scene(one, attributes),
                                                      options_of(one, pipeline, attributes)));
    measurements.push_back({one, pipeline, attributes, sample});
  }
  return {};
}

}  // namespace

// The cases run from small to large. The first six are the least that tells the terms of the model
// apart.
const std::vector<CalibrationCase>& calibration_cases() {
  static const std::vector<CalibrationCase> cases = {
      {64, 4, 200},   {64, 0.4, 8000},    {128, 30, 30},      {256, 1.5, 6000},   {512, 6, 2000},
      {512, 40, 60},  {128, 1, 20000},    {256, 0.25, 60000}, {256, 12, 1500},    {512, 3, 20000},
      {512, 100, 40}, {512, 0.7, 120000}, {384, 25, 1200},    {512, 1.5, 200000}, {512, 8, 12000},
  };
  return cases;
}

Scene calibration_scene(const CalibrationCase& one, bool attributes) {
  Scene scene;
  scene.format = "generated";
  MeshPart part;
  const int across = std::clamp(static_cast<int>(one.size / one.edge) - 1, 1, 1 << 12);
  // Sheets a few voxels apart, each a grid of `across`^2 squares, until there are enough triangles.
  int left = (one.triangle_count + 1) / 2;
  for (int sheet = 0; left > 0; ++sheet) {
    const int rows = std::min(across, (left + across - 1) / across);
    const auto first = static_cast<uint32_t>(part.positions.size());
    const double height = one.size * (0.1 + std::fmod(0.377 * sheet, 0.8));
    for (int y = 0; y <= rows; ++y) {
      for (int x = 0; x <= across; ++x) {
        const double u = one.edge * x, v = one.edge * y;
        part.positions.emplace_back(
            u, height + 0.05 * one.size * (std::sin(0.11 * u) * std::cos(0.07 * v)), v);
        if (attributes) part.colors.emplace_back(0.2f, 0.3f, 0.001f * static_cast<float>(x), 1.0f);
      }
    }
    for (int square = 0; square < across * rows && left > 0; ++square, --left) {
      const uint32_t a =
          first + static_cast<uint32_t>(square / across * (across + 1) + square % across);
      const uint32_t b = a + static_cast<uint32_t>(across) + 1;
      part.indices.insert(part.indices.end(), {a, b, a + 1, a + 1, b, b + 1});
    }
  }
  scene.parts.push_back(std::move(part));
  return scene;
}

Result<std::vector<CalibrationMeasurement>> measure_pipelines(
    Voxelizer& voxelizer, const std::vector<Pipeline>& pipelines, double seconds_max) {
  std::vector<CalibrationMeasurement> measurements;
  for (const Pipeline pipeline : pipelines) {
    for (const bool attributes : {false, true}) {
      const Status measured = measure(voxelizer, pipeline, attributes, seconds_max, measurements);
      // Devices without DeviceTraits::has_int64 refuse attributes and are never chosen for them, so
      // they need no measurement.
      const bool is_refused = attributes && pipeline != Pipeline::kCpu && !measured &&
                              measured.error().code == ErrorCode::kUnsupportedFeature;
      if (!is_refused) VOXELD_TRY(measured);
    }
  }
  return measurements;
}

Result<std::vector<PipelineCosts>> fit_pipelines(
    const std::vector<CalibrationMeasurement>& measurements) {
  std::vector<PipelineCosts> fitted;
  for (const Pipeline pipeline : {Pipeline::kCpu, Pipeline::kCompute, Pipeline::kRaster}) {
    std::array<std::vector<CostSample>, 2> samples;
    for (const CalibrationMeasurement& one : measurements) {
      if (one.pipeline == pipeline) samples[one.attributes ? 1 : 0].push_back(one.sample);
    }
    if (samples[0].empty() && samples[1].empty()) continue;
    PipelineCosts costs{pipeline, {}, {}};
    VOXELD_ASSIGN(costs.occupancy, fit_cost_model(samples[0]));
    costs.attributes = costs.occupancy;
    if (!samples[1].empty()) {
      VOXELD_ASSIGN(costs.attributes, fit_cost_model(samples[1]));
    }
    fitted.push_back(costs);
  }
  return fitted;
}

}  // namespace voxeld
