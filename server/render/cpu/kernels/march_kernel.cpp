#include "server/render/cpu/kernels/march_kernel.h"

#include "server/base/check.h"

namespace voxeld {
namespace {

// In the order of CpuIsa.
constexpr const MarchKernel* kMarchKernels[] = {
    &kMarchKernelPortable,
#if defined(__x86_64__)
    &kMarchKernelSse4,
    &kMarchKernelAvx2,
    &kMarchKernelAvx512,
#endif
};

}  // namespace

const MarchKernel& march_kernel(CpuIsa isa) {
  VOXELD_CHECK(cpu_isa_supported(isa), "instructions that this machine does not have");
  return *kMarchKernels[static_cast<size_t>(isa)];
}

}  // namespace voxeld
