// Marches of many rays at a time, a lane for each: march() of shaders/raymarch/march.glsl, with the
// same bits.
#pragma once

#include <array>
#include <cstdint>

#include "server/base/simd/cpu_isa.h"

namespace voxeld {

// A grid's tables (shaders/shared/raymarch.h).
struct MarchTables {
  const uint32_t* nodes = nullptr;
  const uint32_t* bricks = nullptr;
  std::array<int32_t, 3> low{}, high{};  // cells [low, high) hold all voxels
  std::array<int32_t, 3> tile_dims{};
};

// Rays as GridRay has them, with the other arguments of march().
struct MarchRays {
  static constexpr int kMax = 512;
  template <typename T>
  using Each = std::array<T, kMax>;

  int count = 0;
  alignas(64) std::array<Each<int32_t>, 3> base;
  alignas(64) std::array<Each<int32_t>, 3> cell;  // the first one
  alignas(64) std::array<Each<float>, 3> origin;
  alignas(64) std::array<Each<float>, 3> direction;  // 0 on parallel axes
  alignas(64) std::array<Each<float>, 3> inverse;
  alignas(64) std::array<Each<float>, 4> level_t;
  alignas(64) Each<float> t_max;
  alignas(64) Each<int32_t> steps_max;

  // The distance of the hit, negative if there is none; its first cell; and the axis of the face
  // through which the ray came, -1: it began inside.
  alignas(64) Each<float> t;
  alignas(64) std::array<Each<int32_t>, 3> hit;
  alignas(64) Each<int32_t> axis;
};

// Rays from one point of a surface, all around an axis.
struct MarchFan {
  std::array<int32_t, 3> base{};
  std::array<float, 3> origin{};                    // in cells from `base`
  std::array<float, 3> tangent{}, other{}, axis{};  // in the world
  std::array<float, 3> scale{};                     // sides of a voxel over the longest of them
  std::array<float, 4> section{};                   // a plane of grid space, or 0
  std::array<float, 4> level_t{};
  float length = 0;  // longest voxel sides, behind which hits do not count; 0: none
  int32_t steps_max = 0;
};

struct MarchKernel {
  // Adds rays from the fan's point towards tangent * x[i] + other * y[i] + axis * up[i] to `rays`,
  // and writes the t of a voxel side of each to `per_side`.
  void (*add_fan)(const MarchFan& fan, const float* x, const float* y, const float* up, int count,
                  MarchRays& rays, float* per_side);
  // Sets t, hit and axis.
  void (*march)(const MarchTables& tables, MarchRays& rays);
};

// Aborts if this machine cannot run it (cpu_isa_supported()).
const MarchKernel& march_kernel(CpuIsa isa);

extern const MarchKernel kMarchKernelPortable;
#if defined(__x86_64__)
extern const MarchKernel kMarchKernelSse4, kMarchKernelAvx2, kMarchKernelAvx512;
#endif

}  // namespace voxeld
