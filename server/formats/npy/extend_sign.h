// Fills in the sign of a dense array of signed distances outside the band.
#pragma once

#include <array>
#include <cstddef>
#include <span>

namespace voxeld {

// Replaces NaN by +background or -background, with the sign of the bordering cells. A band extends
// a voxel or more to each side, so no surface lies between two neighbours of which one is outside
// it. sides: cells along the axes, slowest first. All stay NaN if no value is known.
// Has cancellation points.
void extend_sign(std::span<float> values, const std::array<size_t, 3>& sides, float background);

}  // namespace voxeld
