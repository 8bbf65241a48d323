// A cost model of a pipeline: a few numbers that are fitted to measurements.
#pragma once

#include <span>

#include "proto/result.h"
#include "server/voxel/triangles/bin.h"

namespace voxeld {

// The quantities of a request that decide how long a pipeline takes.
struct Workload {
  double tiles = 0;      // tiles that triangles reach
  double triangles = 0;  // after clipping; counted once for each tile that its box reaches
  // Columns that triangles' boxes cover: for each triangle the product of the two longest of
  // (extent in voxels + 1). A triangle smaller than a voxel counts a little over 1.
  double columns = 0;
};

// Estimates the workload from a few thousand evenly spread triangles. bins: those of all triangles
// of the mesh.
Workload estimate_workload(const SnappedMesh& mesh, std::span<const TileBin> bins);

// Milliseconds of a request: job_ms + tile_ms tiles + triangle_ns triangles + column_ns columns. No
// term is negative, so a larger request never costs less.
struct CostModel {
  double job_ms = 0, tile_ms = 0, triangle_ns = 0, column_ns = 0;
  // The median of |predicted - measured| / measured over the fitted samples.
  double error = 0;

  double predict_ms(const Workload& work) const;
};

struct CostSample {
  Workload work;
  double ms = 0;  // measured, > 0
};

// Minimizes the squares of relative errors. Errors: internal if there are fewer than four samples
// or a value is not a positive number.
Result<CostModel> fit_cost_model(std::span<const CostSample> samples);

}  // namespace voxeld
