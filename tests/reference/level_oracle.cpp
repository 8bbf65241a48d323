#include "tests/reference/level_oracle.h"

#include <cmath>

namespace voxeld::reference {
namespace {

long double linear16(int byte) {
  const long double c = byte / 255.0L;
  const long double linear = c <= 0.04045L ? c / 12.92L : std::pow((c + 0.055L) / 1.055L, 2.4L);
  return std::round(65535.0L * linear);
}

LevelMean mean_of(const std::vector<LevelVoxel>& cells) {
  LevelMean mean;
  int colors = 0, normals = 0;
  for (const LevelVoxel& cell : cells) {
    if (cell.color != std::array<int, 4>{}) {
      ++colors;
      for (int c = 0; c < 3; ++c) mean.color[c] += cell.color[3] * linear16(cell.color[c]);
      mean.color[3] += cell.color[3];
    }
    if (cell.normal != std::array<int, 3>{}) {
      ++normals;
      for (int c = 0; c < 3; ++c) mean.normal[c] += cell.normal[c];
    }
  }
  if (colors > 0) {
    mean.has_color = true;
    for (int c = 0; c < 3; ++c) mean.color[c] /= mean.color[3] > 0 ? mean.color[3] : 1;
    mean.color[3] /= colors;
    // No colour is seen.
    if (std::floor(mean.color[3] + 0.5L) == 0) mean.color = {65535, 65535, 65535, 0};
  }
  const long double length = std::hypot(mean.normal[0], mean.normal[1], mean.normal[2]);
  if (normals > 0 && length > 0 && length / normals >= 0.127L) {
    mean.has_normal = true;
    for (long double& c : mean.normal) c /= length;
  }
  return mean;
}

}  // namespace

long double srgb255(long double linear16_value) {
  const long double c = linear16_value / 65535.0L;
  return 255.0L * (c <= 0.0031308L ? 12.92L * c : 1.055L * std::pow(c, 1.0L / 2.4L) - 0.055L);
}

std::map<std::array<int, 3>, LevelMean> level_oracle(const std::vector<LevelVoxel>& voxels,
                                                     int level, bool majority) {
  const int side = 1 << level;
  std::map<std::array<int, 3>, std::vector<LevelVoxel>> cubes;
  for (const LevelVoxel& voxel : voxels) {
    cubes[{voxel.cell[0] / side, voxel.cell[1] / side, voxel.cell[2] / side}].push_back(voxel);
  }
  std::map<std::array<int, 3>, LevelMean> out;
  for (const auto& [cell, cells] : cubes) {
    const double half = 0.5 * side * side * side;
    if (majority && static_cast<double>(cells.size()) < half) continue;
    out[cell] = mean_of(cells);
  }
  return out;
}

}  // namespace voxeld::reference
