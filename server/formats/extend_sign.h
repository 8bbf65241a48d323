// Cells of a dense array of signed distances that are not in the band.
#pragma once

#include <array>
#include <cstddef>
#include <span>

namespace voxeld {

// Gives values that are NaN +background or -background, as the cells that they border on: between
// two neighbours of which one is not in a band of a voxel or more to each side, there is no
// surface. sides: cells along the axes, the one that changes slowest first. +background where no
// value is known.
void extend_sign(std::span<float> values, const std::array<size_t, 3>& sides, float background);

}  // namespace voxeld
