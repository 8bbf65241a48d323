#pragma once

#include "server/voxel/cpu/touch_kernel.h"

namespace voxeld {

extern const TouchKernel kTouchKernelWide;

}  // namespace voxeld
