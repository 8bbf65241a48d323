#define VOXELD_LANE_BYTES 16
#include "server/voxel/cpu/kernels/touch_kernel_body.h"

namespace voxeld {

const TouchKernel kTouchKernelPortable = {touch, thin, center, compact, join};

}  // namespace voxeld
