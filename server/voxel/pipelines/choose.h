// The choice of the pipeline that runs a request. It decides how long the request takes, never a
// bit of its result.
#pragma once

#include <optional>
#include <string>

#include "proto/options/options.h"
#include "server/voxel/estimates/calibration.h"
#include "server/voxel/estimates/cost_model.h"
#include "server/voxel/pipelines/device_faults.h"
#include "server/voxel/pipelines/tile_pipeline.h"

namespace voxeld {

struct PipelineDecision {
  Pipeline pipeline = Pipeline::kCpu;
  std::string reason;
  std::optional<double> predicted_ms;  // time of the passes; only from a calibration
};

// The device and its calibration, or why it has none. A calibration that is not found and has an
// empty `why_not` was never looked up.
struct ChoiceContext {
  const DeviceTraits* device = nullptr;  // null: no GL context, only pipeline cpu
  const CalibrationLookup& calibration;
  const DeviceFaults* faults = nullptr;  // pipelines that `auto` must not take; null: none
};

// The pipeline that the request names; nullopt for `auto`.
std::optional<Pipeline> asked_pipeline(PipelineChoice asked);

// Chooses the pipeline. For `auto` on a calibrated device that is the one with the least predicted
// time. Without a calibration it is cpu on software drivers and without GL, compute on hardware.
// The reason names the predictions, or how to get them.
PipelineDecision decide_pipeline(PipelineChoice asked, const ChoiceContext& context,
                                 const Workload& work, bool attributes);

// "8.1 ms", "0.25 ms", "1200 ms": at most two significant digits.
std::string milliseconds_text(double ms);

}  // namespace voxeld
