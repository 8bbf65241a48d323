// Measurement of a device's pipelines on generated meshes.
#pragma once

#include <vector>

#include "proto/result.h"
#include "server/scene/core/scene.h"
#include "server/voxel/estimates/calibration.h"
#include "server/voxel/voxelize.h"

namespace voxeld {

// One mesh to measure: sheets of waves with `triangle_count` triangles, whose edges are `edge`
// voxels long, in a grid of `size`^3 cells.
struct CalibrationCase {
  int size = 0;
  double edge = 0;
  int triangle_count = 0;
};

// Cases from sub-voxel to large triangles and from one tile to eight. Each term of the cost model
// is large in some of them and small in others, so that the fit can tell the terms apart.
const std::vector<CalibrationCase>& calibration_cases();

// The mesh of a case, in voxels, with a colour per vertex if `attributes`. Deterministic.
Scene calibration_scene(const CalibrationCase& one, bool attributes);

struct CalibrationMeasurement {
  CalibrationCase made_from;
  Pipeline pipeline = Pipeline::kCpu;
  bool attributes = false;
  CostSample sample;
};

// Measures each case with each of `pipelines`: the median of a few runs. The time excludes placing,
// snapping and binning, which all pipelines share. A pipeline gets at most `seconds_max` for either
// kind of grid; after that the largest cases are left out. Errors: those of voxelize().
Result<std::vector<CalibrationMeasurement>> measure_pipelines(
    Voxelizer& voxelizer, const std::vector<Pipeline>& pipelines, double seconds_max = 1.5);

// Fits a cost model to each pipeline's measurements. Errors: those of fit_cost_model().
Result<std::vector<PipelineCosts>> fit_pipelines(
    const std::vector<CalibrationMeasurement>& measurements);

}  // namespace voxeld
