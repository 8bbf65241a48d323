#include "server/voxel/cpu/kernels/touch_kernel.h"

#include "server/base/check.h"

namespace voxeld {

namespace {

// In the order of CpuIsa.
constexpr const TouchKernel* kTouchKernels[] = {
    &kTouchKernelPortable,
#if defined(__x86_64__)
    &kTouchKernelSse4,
    &kTouchKernelAvx2,
    &kTouchKernelAvx512,
#endif
};

}  // namespace

const TouchKernel& touch_kernel(CpuIsa isa) {
  VOXELD_CHECK(cpu_isa_supported(isa), "instructions that this machine does not have");
  return *kTouchKernels[static_cast<size_t>(isa)];
}

}  // namespace voxeld
