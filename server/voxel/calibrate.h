// Measures the pipelines of a device.
#pragma once

#include <vector>

#include "proto/result.h"
#include "server/scene/scene.h"
#include "server/voxel/calibration.h"
#include "server/voxel/voxelize.h"

namespace voxeld {

// One mesh that is measured: sheets of waves, `triangle_count` triangles with edges of `edge`
// voxels, in a grid of `size`^3 cells.
struct CalibrationCase {
  int size = 0;
  double edge = 0;
  int triangle_count = 0;
};

// From sub-voxel triangles to large ones and from one tile to eight, each term of the cost model
// large in some and small in others.
const std::vector<CalibrationCase>& calibration_cases();

// The mesh of a case, in voxels; with a colour per vertex where `attributes`. The same each time.
Scene calibration_scene(const CalibrationCase& one, bool attributes);

struct CalibrationMeasurement {
  CalibrationCase made_from;
  Pipeline pipeline = Pipeline::kCpu;
  bool attributes = false;
  CostSample sample;
};

// The median of a few runs of each case by each of `pipelines`, without what all of them share
// (placing, snapping, binning). A pipeline gets at most `seconds_max` for either kind of grid;
// then the largest cases are left out. Errors: those of voxelize().
Result<std::vector<CalibrationMeasurement>> measure_pipelines(
    Voxelizer& voxelizer, const std::vector<Pipeline>& pipelines, double seconds_max = 1.5);

// Errors: those of fit_cost_model().
Result<std::vector<PipelineCosts>> fit_pipelines(
    const std::vector<CalibrationMeasurement>& measurements);

}  // namespace voxeld
