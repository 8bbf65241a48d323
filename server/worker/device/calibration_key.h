// The key under which a device's measurements are stored.
#pragma once

#include "server/base/algorithm_version.h"
#include "server/device/device.h"
#include "server/process/machine.h"
#include "server/voxel/estimates/calibration.h"

namespace voxeld {

inline CalibrationKey calibration_key(const gpu::DeviceInfo& info) {
  return {info.renderer, info.version, cpu_model(), cpu_thread_count(), kAlgorithmVersion};
}

}  // namespace voxeld
