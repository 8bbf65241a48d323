// The costs of jobs before any was measured: sums over their parts, each with a cost per byte, per
// cell of the grid, or per cell of one of its sides, as measured on two cores without a GPU
// (tests/bench/long_jobs.py).
#pragma once

#include "proto/messages/job.h"
#include "server/jobs/estimates/job_input.h"

namespace voxeld {

struct JobGuess {
  double read_seconds = 0;
  // For one frame.
  double work_seconds = 0, device_seconds = 0;
  double result_bytes = 0, host_bytes = 0;
};

JobGuess guess_costs(JobKind kind, const RequestOptions& options, const JobInput& input);

// Voxels along the longest side of the grid that a request names.
double longest_side(const PlacementOptions& placement);
// Rays along the side of a square image with as many rays as the request's.
double ray_side(const RenderOptions& render);

}  // namespace voxeld
