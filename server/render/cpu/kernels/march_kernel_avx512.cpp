#define VOXELD_LANE_BYTES 64
#include "server/render/cpu/kernels/march_kernel_body.h"

namespace voxeld {

const MarchKernel kMarchKernelAvx512 = {add_fan, march};

}  // namespace voxeld
