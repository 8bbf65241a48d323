// What a fill found out about the mesh.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "proto/options.h"

namespace voxeld {

struct FillStats {
  Sign sign = Sign::kAuto;  // that was taken; never kAuto, except kAuto's mixture: see `reason`
  std::string reason;       // why `auto` took it, or "asked for"
  // Edges at which the snapped mesh does not close, where it was looked at (sign auto and winding).
  std::optional<int64_t> boundary_edges;
  // Of the cells that parity along at least one axis finds inside, the share on which the three
  // axes disagree and that are not surface. 0 for closed meshes; unset where it was not looked at.
  std::optional<double> ambiguous_fraction;
};

}  // namespace voxeld
