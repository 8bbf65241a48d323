#include "server/voxel/pipelines/fallback.h"

namespace voxeld {

bool may_fall_back(const VoxelizeOptions& options, const Error& error) {
  return options.pipeline == PipelineChoice::kAuto &&
         (error.code == ErrorCode::kInternal || error.code == ErrorCode::kDeviceUnavailable);
}

void record_fallback(const Error& error, VoxelizeStats& stats) {
  if (stats.device_failure.empty()) stats.device_failure = error.message();
  stats.pipeline_reason = "cpu: " + std::string(pipeline_name(stats.pipeline)) +
                          " failed on the device: " + stats.device_failure;
  stats.pipeline = Pipeline::kCpu;
}

}  // namespace voxeld
