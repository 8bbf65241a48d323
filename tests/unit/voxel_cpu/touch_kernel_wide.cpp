// The kernel as wide as AVX-512's, of instructions that every machine has, so that it is tested on
// machines without AVX-512.
#define VOXELD_LANE_BYTES 64
#include "tests/unit/voxel_cpu/touch_kernel_wide.h"

#include "server/voxel/cpu/kernels/touch_kernel_body.h"

namespace voxeld {

const TouchKernel kTouchKernelWide = {touch, thin, center, compact, join};

}  // namespace voxeld
