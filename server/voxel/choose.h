// Which pipeline runs a request. It decides how long that takes, never a bit of the result.
#pragma once

#include <optional>
#include <string>

#include "proto/options.h"
#include "server/voxel/calibration.h"
#include "server/voxel/cost_model.h"
#include "server/voxel/tile_pipeline.h"

namespace voxeld {

struct PipelineDecision {
  Pipeline pipeline = Pipeline::kCpu;
  std::string reason;
  std::optional<double> predicted_ms;  // of the passes, from a calibration
};

// Of the device: found or why not. Empty text and not found: nobody asked.
struct ChoiceContext {
  const DeviceTraits* device = nullptr;  // null: no GL context, pipeline cpu alone
  const CalibrationLookup& calibration;
};

// What the request names. Nothing for `auto`.
std::optional<Pipeline> asked_pipeline(PipelineChoice asked);

// `auto`: the pipeline with the least predicted time where the device is calibrated; else cpu on
// software drivers and without GL, compute on hardware. The reason tells the predictions, or how
// to get them.
PipelineDecision decide_pipeline(PipelineChoice asked, const ChoiceContext& context,
                                 const Workload& work, bool attributes);

// "8.1 ms", "0.25 ms", "1200 ms": two digits that count, no more.
std::string milliseconds_text(double ms);

}  // namespace voxeld
