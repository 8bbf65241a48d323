// The length of single dispatches. A GPU whose dispatch lasts for seconds is reset by its driver,
// and a cancelled job waits until the running dispatch ends.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>

#include "proto/result.h"
#include "server/gpu/context.h"
#include "server/voxel/estimates/cost_model.h"
#include "server/voxel/pipelines/tile_pipeline.h"

namespace voxeld {

// Caps the work of a dispatch at what takes some 50 ms as predicted, and waits between the
// dispatches of a pass that this cuts.
class DispatchPace {
 public:
  // columns: of one dispatch, in place of the prediction; tests force it.
  DispatchPace(const gpu::Context& context, std::optional<double> columns)
      : context_(&context), forced_columns_(columns) {}

  // model: the calibrated costs of the job's pipeline; null: not calibrated, so those of a slow GPU
  // are assumed. work: that of the job.
  void begin_job(const CostModel* model, const Workload& work, bool has_attributes);
  // Called between dispatches, until the next call. Null: nothing is.
  void set_pause(const TilePipeline::Pause* pause) { pause_ = pause; }

  // Work items of one dispatch: a multiple of 64. An item is a triangle's part of at most `columns`
  // columns.
  size_t items(int columns) const;
  // Triangles of one dispatch.
  size_t triangles() const;
  // Waits for the device, then tells the progress. Errors: cancelled.
  Status rest() const;

 private:
  const gpu::Context* context_;
  std::optional<double> forced_columns_;
  double columns_ = 0;  // of a dispatch
  double columns_per_triangle_ = 0;
  const TilePipeline::Pause* pause_ = nullptr;
};

}  // namespace voxeld
