// Instruction sets that the kernels of pipeline `cpu` are compiled for. All give the same bits.
#pragma once

#include <string_view>
#include <vector>

namespace voxeld {

// In ascending order of vector width.
enum class CpuIsa {
  kPortable,  // what the compiler targets by default; on every architecture
  kSse4,      // SSE4.2, POPCNT
  kAvx2,      // AVX2, FMA, BMI2
  kAvx512,    // AVX-512 F, BW, DQ, VL
};

std::string_view cpu_isa_name(CpuIsa isa);

// Whether this build has the kernels and this machine runs them.
bool cpu_isa_supported(CpuIsa isa);

// Ascending; kPortable is always there.
std::vector<CpuIsa> supported_cpu_isas();

// The widest that is supported.
CpuIsa best_cpu_isa();

}  // namespace voxeld
