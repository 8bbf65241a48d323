#include "server/voxel/pipelines/choose.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

namespace voxeld {
namespace {

struct Prediction {
  Pipeline pipeline;
  double ms;
};

// True if the device's pipelines cannot run the request.
bool needs_cpu(const ChoiceContext& context, bool attributes) {
  return context.device == nullptr || (attributes && !context.device->has_int64);
}

// True if the device's self-test found a fault in the pipeline.
bool is_faulty(const ChoiceContext& context, Pipeline pipeline, bool attributes) {
  return pipeline != Pipeline::kCpu && context.faults != nullptr &&
         context.faults->has(surface_part(pipeline, attributes));
}

// Names the pipelines that are left out for a fault, for the end of a reason.
std::string faulty_text(const ChoiceContext& context, bool attributes) {
  std::string names;
  for (const Pipeline one : {Pipeline::kCompute, Pipeline::kRaster}) {
    if (!is_faulty(context, one, attributes)) continue;
    names.append(names.empty() ? "" : " and ").append(pipeline_name(one));
  }
  return names.empty() ? "" : "; the device failed the self-test of " + names;
}

// Predictions of the pipelines that can run the request, fastest first.
std::vector<Prediction> predictions(const ChoiceContext& context, const Workload& work,
                                    bool attributes) {
  std::vector<Prediction> found;
  for (const Pipeline one : {Pipeline::kCpu, Pipeline::kCompute, Pipeline::kRaster}) {
    if (one != Pipeline::kCpu && needs_cpu(context, attributes)) continue;
    if (is_faulty(context, one, attributes)) continue;
    const CostModel* model = context.calibration.calibration.model(one, attributes);
    if (model != nullptr) found.push_back({one, model->predict_ms(work)});
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Prediction& a, const Prediction& b) { return a.ms < b.ms; });
  return found;
}

PipelineDecision fastest(const std::vector<Prediction>& by_time, const std::string& date) {
  PipelineDecision decision;
  decision.pipeline = by_time.front().pipeline;
  decision.predicted_ms = by_time.front().ms;
  decision.reason = std::string(pipeline_name(decision.pipeline)) + ": predicted " +
                    milliseconds_text(by_time.front().ms);
  for (size_t i = 1; i < by_time.size(); ++i) {
    decision.reason += ", " + std::string(pipeline_name(by_time[i].pipeline)) + " " +
                       milliseconds_text(by_time[i].ms);
  }
  decision.reason += " (calibrated " + date + ")";
  return decision;
}

PipelineDecision by_rule(const ChoiceContext& context, bool attributes) {
  if (context.device == nullptr) return {Pipeline::kCpu, "cpu: there is no GL context", {}};
  if (needs_cpu(context, attributes)) {
    return {Pipeline::kCpu,
            "cpu: attributes need 64-bit integers in shaders, which the device does not have",
            {}};
  }
  std::string how;
  if (!context.calibration.why_not.empty()) {
    how = " (" + context.calibration.why_not + ": `voxeld doctor --calibrate` measures)";
  }
  if (context.device->is_software) {
    return {Pipeline::kCpu,
            "cpu: the device is a software driver, which would run shaders on the same cores" + how,
            {}};
  }
  if (!is_faulty(context, Pipeline::kCompute, attributes)) {
    return {Pipeline::kCompute,
            "compute: the device is hardware, and hardware for data centres has few units that "
            "rasterize" +
                how,
            {}};
  }
  if (!is_faulty(context, Pipeline::kRaster, attributes)) {
    return {Pipeline::kRaster, "raster: the device is hardware" + how, {}};
  }
  return {Pipeline::kCpu, "cpu: it makes the bytes that the device should", {}};
}

}  // namespace

std::optional<Pipeline> asked_pipeline(PipelineChoice asked) {
  switch (asked) {
    case PipelineChoice::kRaster:
      return Pipeline::kRaster;
    case PipelineChoice::kCompute:
      return Pipeline::kCompute;
    case PipelineChoice::kCpu:
      return Pipeline::kCpu;
    case PipelineChoice::kAuto:
      break;
  }
  return std::nullopt;
}

PipelineDecision decide_pipeline(PipelineChoice asked, const ChoiceContext& context,
                                 const Workload& work, bool attributes) {
  if (const auto named = asked_pipeline(asked)) {
    const CostModel* model = context.calibration.calibration.model(*named, attributes);
    PipelineDecision decision{*named, "asked for", {}};
    if (model != nullptr) decision.predicted_ms = model->predict_ms(work);
    return decision;
  }
  if (context.calibration.found) {
    const std::vector<Prediction> by_time = predictions(context, work, attributes);
    if (!by_time.empty()) {
      PipelineDecision decision = fastest(by_time, context.calibration.calibration.date);
      decision.reason += faulty_text(context, attributes);
      return decision;
    }
  }
  PipelineDecision decision = by_rule(context, attributes);
  if (context.device != nullptr && !context.device->is_software) {
    decision.reason += faulty_text(context, attributes);
  }
  return decision;
}

std::string milliseconds_text(double ms) {
  char text[32];
  if (ms >= 100) {
    const double step = std::pow(10.0, std::floor(std::log10(ms)) - 1);
    std::snprintf(text, sizeof text, "%.0f ms", std::round(ms / step) * step);
  } else {
    std::snprintf(text, sizeof text, "%.2g ms", ms);
  }
  return text;
}

}  // namespace voxeld
