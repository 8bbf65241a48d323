// The definition of a level of detail: every cube of cells on its own, found by division, its mean
// by long double arithmetic over the list of its cells. Shares no code with the daemon.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <vector>

namespace voxeld::reference {

struct LevelVoxel {
  std::array<int, 3> cell{};
  std::array<int, 4> color{};   // sRGB R, G, B and linear A; all zero: none
  std::array<int, 3> normal{};  // times 127; all zero: none
};

struct LevelMean {
  // Exact means before rounding: 16-bit linear light for R, G, B (of cells with a colour), and A.
  bool has_color = false, has_normal = false;
  std::array<long double, 4> color{};
  std::array<long double, 3> normal{};  // of length 1 where there is one
};

// The occupied voxels of level `level`. majority: at least half of all cells of the cube, those
// beyond the grid's dims counted as empty.
std::map<std::array<int, 3>, LevelMean> level_oracle(const std::vector<LevelVoxel>& voxels,
                                                     int level, bool majority);

// The sRGB byte of 16-bit linear light; before rounding.
long double srgb255(long double linear16);

}  // namespace voxeld::reference
