#define VOXELD_LANE_BYTES 32
#include "server/render/cpu/kernels/march_kernel_body.h"

namespace voxeld {

const MarchKernel kMarchKernelAvx2 = {add_fan, march};

}  // namespace voxeld
