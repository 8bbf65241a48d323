#define VOXELD_LANE_BYTES 16
#include "server/voxel/cpu/kernels/attributes/attribute_kernel_body.h"

namespace voxeld {

const AttributeKernel kAttributeKernelSse4 = {add, measure};

}  // namespace voxeld
