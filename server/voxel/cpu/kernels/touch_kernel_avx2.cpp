#define VOXELD_LANE_BYTES 32
#include "server/voxel/cpu/kernels/touch_kernel_body.h"

namespace voxeld {

const TouchKernel kTouchKernelAvx2 = {touch, thin, center, compact, join};

}  // namespace voxeld
