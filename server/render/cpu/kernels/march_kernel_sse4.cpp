#define VOXELD_LANE_BYTES 16
#include "server/render/cpu/kernels/march_kernel_body.h"

namespace voxeld {

const MarchKernel kMarchKernelSse4 = {add_fan, march};

}  // namespace voxeld
