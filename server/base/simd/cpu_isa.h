// The instruction sets for which kernels in vector lanes are compiled. All give the same
// bits.
#pragma once

#include <string_view>
#include <vector>

namespace voxeld {

// Instruction sets in ascending order of vector width.
enum class CpuIsa {
  kPortable,  // the compiler's default target, on every architecture
  kSse4,      // SSE4.2, POPCNT
  kAvx2,      // AVX2, FMA, BMI2
  kAvx512,    // AVX-512 F, BW, DQ, VL
};

std::string_view cpu_isa_name(CpuIsa isa);

// True if this build has the kernels and this machine can run them.
bool cpu_isa_supported(CpuIsa isa);

// Supported sets, ascending. kPortable is always among them.
std::vector<CpuIsa> supported_cpu_isas();

// The widest supported set.
CpuIsa best_cpu_isa();

}  // namespace voxeld
