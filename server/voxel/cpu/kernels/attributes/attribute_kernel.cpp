#include "server/voxel/cpu/kernels/attributes/attribute_kernel.h"

#include "server/base/check.h"

namespace voxeld {

namespace {

// In the order of CpuIsa.
constexpr const AttributeKernel* kAttributeKernels[] = {
    &kAttributeKernelPortable,
#if defined(__x86_64__)
    &kAttributeKernelSse4,
    &kAttributeKernelAvx2,
    &kAttributeKernelAvx512,
#endif
};

}  // namespace

const AttributeKernel& attribute_kernel(CpuIsa isa) {
  VOXELD_CHECK(cpu_isa_supported(isa), "instructions that this machine does not have");
  return *kAttributeKernels[static_cast<size_t>(isa)];
}

}  // namespace voxeld
