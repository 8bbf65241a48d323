#include "server/render/cpu/ground_cells.h"

namespace voxeld {

GroundCells::GroundCells(int width)
    : width_(width), stride_((width + kSide - 1) / kSide * kSide + 1) {
  const size_t pixels = index(0, kSide + 1);
  values_.resize(pixels);
  wanted_.resize(pixels);
}

void GroundCells::begin() {
  std::ranges::fill(values_, kUnknown);
  std::ranges::fill(wanted_, 0);
}

bool GroundCells::has_wanted(int x0, int row0, int side) const {
  for (int row = row0; row < row0 + side; ++row) {
    for (int x = x0; x < x0 + side; ++x) {
      if (wanted_[index(x, row)] != 0) return true;
    }
  }
  return false;
}

// Bilinearly, where a value is wanted and not known.
void GroundCells::interpolate(int x0, int row0, int side) {
  const float a = value(x0, row0), b = value(x0 + side, row0);
  const float c = value(x0, row0 + side), d = value(x0 + side, row0 + side);
  for (int row = 0; row < side; ++row) {
    const float v = static_cast<float>(row) / static_cast<float>(side);
    const float left = a + (c - a) * v, right = b + (d - b) * v;
    for (int x = 0; x < side; ++x) {
      float& out = values_[index(x0 + x, row0 + row)];
      if (out != kUnknown) continue;
      out = left + (right - left) * static_cast<float>(x) / static_cast<float>(side);
    }
  }
}

}  // namespace voxeld
