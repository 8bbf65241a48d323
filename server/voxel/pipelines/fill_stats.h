// Statistics of a fill, e.g. how well the mesh closes.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "proto/options/options.h"

namespace voxeld {

struct FillStats {
  // The rule that was used. It is kAuto only for that rule's mixture, see `reason`.
  Sign sign = Sign::kAuto;
  std::string reason;  // why `auto` chose it, or "asked for"
  // Edges at which the snapped mesh does not close; set only for sign auto and winding.
  std::optional<int64_t> boundary_edges;
  // The share of ambiguous cells among those that parity finds inside along at least one axis. A
  // cell is ambiguous if the three axes disagree and it is not surface; with kAuto also only if its
  // region does not decide. 0 for closed meshes; unset if it was not measured.
  std::optional<double> ambiguous_fraction;
  // If no cell beside the surface is inside: another sign that finds some. Unset if none does.
  std::optional<Sign> sign_with_inside;
};

}  // namespace voxeld
