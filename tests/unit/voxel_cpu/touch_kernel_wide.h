#pragma once

#include "server/voxel/cpu/kernels/touch_kernel.h"

namespace voxeld {

extern const TouchKernel kTouchKernelWide;

}  // namespace voxeld
