// What a pipeline costs, as a few numbers that are fitted to measurements.
#pragma once

#include <span>

#include "proto/result.h"
#include "server/voxel/bin.h"

namespace voxeld {

// What of a request decides how long a pipeline takes.
struct Workload {
  double tiles = 0;      // that triangles reach
  double triangles = 0;  // after clipping, once for each tile that the box reaches
  // Columns that triangles' boxes cover: the product of the two longest of (extent in voxels + 1),
  // summed. A triangle smaller than a voxel counts a little over 1.
  double columns = 0;
};

// `bins`: of all triangles of the mesh. Reads some thousand triangles, evenly spread.
Workload estimate_workload(const SnappedMesh& mesh, std::span<const TileBin> bins);

// Milliseconds of a request: job_ms + tile_ms tiles + triangle_ns triangles + column_ns columns.
// No term is negative, so larger requests never cost less.
struct CostModel {
  double job_ms = 0, tile_ms = 0, triangle_ns = 0, column_ns = 0;
  // Of what was fitted: the median of |predicted - measured| / measured.
  double error = 0;

  double predict_ms(const Workload& work) const;
};

struct CostSample {
  Workload work;
  double ms = 0;  // measured, > 0
};

// The least squares of relative errors. Errors: internal with fewer than four samples or one that
// is not a positive number.
Result<CostModel> fit_cost_model(std::span<const CostSample> samples);

}  // namespace voxeld
