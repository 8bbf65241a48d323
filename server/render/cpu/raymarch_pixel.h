// One invocation of the ray march pass on the CPU.
#pragma once

#include <array>
#include <cstdint>

#include "server/render/packed_grid.h"
#include "server/render/raymarch_params.h"
#include "server/render/render.h"
#include "shaders/shared/raymarch.h"

namespace voxeld {

// What GL binds: a picture's parameters and a grid's tables, which must outlive it.
struct RaymarchBindings {
  const shared::RaymarchParams& params;
  const PackedGrid& grid;
  RaymarchVariant variant;  // hits have none
};

// `x`, `y`: pixel, y from the bottom. RGBA, sRGB and straight alpha.
std::array<uint8_t, 4> raymarch_color(const RaymarchBindings& bindings, int x, int y);
Hit raymarch_hit(const RaymarchBindings& bindings, int x, int y);

}  // namespace voxeld
