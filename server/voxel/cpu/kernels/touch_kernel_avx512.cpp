#define VOXELD_LANE_BYTES 64
#include "server/voxel/cpu/kernels/touch_kernel_body.h"

namespace voxeld {

const TouchKernel kTouchKernelAvx512 = {touch, thin, center, compact, join};

}  // namespace voxeld
