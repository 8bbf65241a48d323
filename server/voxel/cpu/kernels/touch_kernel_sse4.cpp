#define VOXELD_LANE_BYTES 16
#include "server/voxel/cpu/kernels/touch_kernel_body.h"

namespace voxeld {

const TouchKernel kTouchKernelSse4 = {touch, thin, center, compact, join};

}  // namespace voxeld
