#include "server/voxel/cpu/kernels/touch_kernel.h"

#include "server/base/check.h"

namespace voxeld {

const TouchKernel& touch_kernel(CpuIsa isa) {
  VOXELD_CHECK(cpu_isa_supported(isa), "instructions that this machine does not have");
#if defined(__x86_64__)
  switch (isa) {
    case CpuIsa::kPortable:
      return kTouchKernelPortable;
    case CpuIsa::kSse4:
      return kTouchKernelSse4;
    case CpuIsa::kAvx2:
      return kTouchKernelAvx2;
    case CpuIsa::kAvx512:
      return kTouchKernelAvx512;
  }
#endif
  return kTouchKernelPortable;
}

}  // namespace voxeld
