#define VOXELD_LANE_BYTES 32
#include "server/voxel/cpu/kernels/attributes/attribute_kernel_body.h"

namespace voxeld {

const AttributeKernel kAttributeKernelAvx2 = {add, measure};

}  // namespace voxeld
