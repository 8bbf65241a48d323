#define VOXELD_LANE_BYTES 64
#include "server/voxel/cpu/kernels/attributes/attribute_kernel_body.h"

namespace voxeld {

const AttributeKernel kAttributeKernelAvx512 = {add, measure};

}  // namespace voxeld
