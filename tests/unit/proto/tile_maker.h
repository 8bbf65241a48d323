// Makes tiles from lists of cells, for the tests of everything that reads or writes them.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <random>
#include <vector>

#include "proto/sparse_tile.h"

namespace voxeld::test {

struct TestVoxel {
  std::array<int, 3> cell{};  // of the grid
  std::array<uint8_t, 4> color{};
  std::array<int8_t, 3> normal{};
  bool operator==(const TestVoxel&) const = default;
};

// Tiles of the voxels, by coord; of voxels in the same cell the first stays.
inline std::vector<SparseTile> tiles_of(const std::vector<TestVoxel>& voxels, bool has_color,
                                        bool has_normal) {
  constexpr int kSide = limits::kTileSide;
  std::map<std::array<int, 3>, std::map<uint32_t, TestVoxel>> by_tile;
  for (const TestVoxel& voxel : voxels) {
    const auto& [x, y, z] = voxel.cell;
    by_tile[{x / kSide, y / kSide, z / kSide}].try_emplace(
        morton_encode(static_cast<uint32_t>(x % kSide), static_cast<uint32_t>(y % kSide),
                      static_cast<uint32_t>(z % kSide)),
        voxel);
  }
  std::vector<SparseTile> tiles;
  for (const auto& [coord, cells] : by_tile) {
    SparseTile& tile = tiles.emplace_back();
    tile.coord = coord;
    for (const auto& [code, voxel] : cells) {
      if (tile.brick_morton.empty() || tile.brick_morton.back() != code >> 9) {
        tile.brick_morton.push_back(code >> 9);
        tile.masks.emplace_back();
      }
      tile.masks.back().words[code >> 6 & 7] |= uint64_t{1} << (code & 63);
      if (has_color) tile.color.insert(tile.color.end(), voxel.color.begin(), voxel.color.end());
      if (has_normal) {
        tile.normal.insert(tile.normal.end(), voxel.normal.begin(), voxel.normal.end());
      }
    }
  }
  return tiles;
}

inline int below(std::mt19937& random, int end) {
  return static_cast<int>(random() % static_cast<uint32_t>(end));
}

// Clusters and single voxels, so that full, sparse and empty nodes all occur.
inline std::vector<TestVoxel> random_voxels(std::mt19937& random, const std::array<int, 3>& dims,
                                            int count) {
  std::vector<TestVoxel> voxels;
  std::array<int, 3> at{};
  for (int i = 0; i < count; ++i) {
    TestVoxel voxel;
    const bool jump = i == 0 || below(random, 16) == 0;
    for (size_t c = 0; c < 3; ++c) {
      at[c] =
          jump ? below(random, dims[c]) : std::clamp(at[c] + below(random, 3) - 1, 0, dims[c] - 1);
      voxel.normal[c] = static_cast<int8_t>(below(random, 255) - 127);
    }
    voxel.cell = at;
    for (uint8_t& channel : voxel.color) channel = static_cast<uint8_t>(random());
    voxels.push_back(voxel);
  }
  return voxels;
}

// Every cell of a box [min, max).
inline std::vector<TestVoxel> box_voxels(const std::array<int, 3>& min,
                                         const std::array<int, 3>& max) {
  std::vector<TestVoxel> voxels;
  for (int z = min[2]; z < max[2]; ++z) {
    for (int y = min[1]; y < max[1]; ++y) {
      for (int x = min[0]; x < max[0]; ++x) {
        voxels.push_back({{x, y, z},
                          {static_cast<uint8_t>(x), static_cast<uint8_t>(y),
                           static_cast<uint8_t>(z), uint8_t{255}},
                          {int8_t{127}, int8_t{0}, int8_t{-127}}});
      }
    }
  }
  return voxels;
}

}  // namespace voxeld::test
