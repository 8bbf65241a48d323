// One invocation of the ray march pass on the CPU.
#pragma once

#include <array>
#include <cstdint>

#include "server/render/packed_grid.h"
#include "server/render/raymarch_params.h"
#include "server/render/render.h"
#include "shaders/shared/raymarch.h"

namespace voxeld {

// The data that GL would bind: an image's parameters and a grid's tables. Both must outlive this.
struct RaymarchBindings {
  const shared::RaymarchParams& params;
  const PackedGrid& grid;
  RaymarchVariant variant;  // not used for hits
};

// The colour of pixel x, y (y from the bottom) as RGBA, sRGB with straight alpha.
std::array<uint8_t, 4> raymarch_color(const RaymarchBindings& bindings, int x, int y);
Hit raymarch_hit(const RaymarchBindings& bindings, int x, int y);

}  // namespace voxeld
