// How a texture continues beyond its sides, for one triangle and one axis.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "server/scene/core/scene.h"

namespace voxeld {

struct TexturePeriod {
  double below = 0.0;  // whole periods to subtract, so that coordinates start within the first
  Wrap wrap = Wrap::kClamp;
};

// u: the corners' coordinates. A triangle within one period of a repeating texture does not show
// the opposite side, so the texture ends at its sides.
inline TexturePeriod texture_period(Wrap wrap, const std::array<double, 3>& u) {
  constexpr double kRounding = 0x1p-21;  // coordinates are rounded to 2^-20
  const double least = std::min({u[0], u[1], u[2]}), most = std::max({u[0], u[1], u[2]});
  if (wrap == Wrap::kClamp) return {0.0, wrap};
  if (wrap == Wrap::kMirror) return {2.0 * std::floor(least / 2.0), wrap};
  const double below = std::floor(least + kRounding);
  return {below, most - below < 1.0 + kRounding ? Wrap::kClamp : wrap};
}

}  // namespace voxeld
