#define VOXELD_LANE_BYTES 16
#include "server/render/cpu/kernels/march_kernel_body.h"

namespace voxeld {

const MarchKernel kMarchKernelPortable = {add_fan, march};

}  // namespace voxeld
