// Makes tiles from lists of cells, for the tests of everything that reads or writes them.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <random>
#include <type_traits>
#include <vector>

#include "proto/codec/sparse_tile.h"

namespace voxeld::test {

struct TestVoxel {
  std::array<int, 3> cell{};  // of the grid
  std::array<uint8_t, 4> color{};
  std::array<int8_t, 3> normal{};
  uint16_t material = 0, label = 0;
  int16_t distance = 0;
  uint8_t coverage = 0;
  bool operator==(const TestVoxel&) const = default;
};

// Tiles of the voxels, by coord; of voxels in the same cell the first stays.
inline std::vector<SparseTile> tiles_of(const std::vector<TestVoxel>& voxels,
                                        const ChannelSet& channels) {
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
      if (channels.color) {
        tile.color.insert(tile.color.end(), voxel.color.begin(), voxel.color.end());
      }
      if (channels.normal) {
        tile.normal.insert(tile.normal.end(), voxel.normal.begin(), voxel.normal.end());
      }
      if (channels.material) tile.material.push_back(voxel.material);
      if (channels.label) tile.label.push_back(voxel.label);
      if (channels.distance) tile.distance.push_back(voxel.distance);
      if (channels.coverage) tile.coverage.push_back(voxel.coverage);
    }
  }
  return tiles;
}

inline std::vector<SparseTile> tiles_of(const std::vector<TestVoxel>& voxels, bool has_color,
                                        bool has_normal) {
  return tiles_of(voxels, {.color = has_color, .normal = has_normal});
}

// Each set of channels there is, by number.
inline constexpr uint32_t kChannelSets = 1u << kChannelCount;

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
    // Ids in patches, distances that change slowly, and now and then anything.
    voxel.material = static_cast<uint16_t>(below(random, 50) == 0 ? random() : 1 + at[0] / 7 % 3);
    voxel.label = static_cast<uint16_t>(1 + (at[0] / 40 + at[1] / 40) * 300);
    voxel.distance = static_cast<int16_t>(
        below(random, 50) == 0 ? random() : static_cast<uint32_t>(128 * at[0] - 90 * at[1]));
    voxel.coverage = static_cast<uint8_t>(at[2] + below(random, 9));
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

// Adds what lies in one node of 2^level bricks: nothing, a full node, a brick of random cells
// (every fourth one full), or its eight children.
inline void add_random_node(std::mt19937& random, uint32_t brick_morton, uint32_t level,
                            SparseTile& tile) {
  const int kind = below(random, 8);
  if (kind == 0) return;
  if (kind <= 2) {
    tile.full.push_back({brick_morton, level});
  } else if (level == 0) {
    tile.brick_morton.push_back(brick_morton);
    BrickMask& mask = tile.masks.emplace_back();
    const bool is_full = below(random, 4) == 0;
    for (uint64_t& word : mask.words) word = is_full ? ~uint64_t{0} : uint64_t{random()} | 1;
  } else {
    for (uint32_t i = 0; i < 8; ++i) {
      if (level > 2 && below(random, 3) != 0) continue;  // keeps it small
      add_random_node(random, brick_morton + (i << 3 * (level - 1)), level - 1, tile);
    }
  }
}

// A canonical tile with full nodes of many sizes beside other bricks; not empty.
inline SparseTile tile_with_full_nodes(std::mt19937& random, const ChannelSet& channels) {
  SparseTile tile;
  for (uint32_t octant = 0; octant < 8; ++octant) {
    add_random_node(random, octant << 12, kTileLevels - 1, tile);
  }
  if (tile.empty()) tile.full.push_back({8, 1});
  resize_channels(tile, channels);
  for_each_channel(tile, [&](Channel channel, auto& samples) {
    for (auto& sample : samples) {
      using Sample = std::remove_reference_t<decltype(sample)>;
      sample = static_cast<Sample>(channel == Channel::kNormal ? below(random, 255) - 127
                                                               : static_cast<int>(random()));
    }
  });
  canonicalize(tile);
  return tile;
}
inline SparseTile tile_with_full_nodes(std::mt19937& random, bool has_color, bool has_normal) {
  return tile_with_full_nodes(random, {.color = has_color, .normal = has_normal});
}

}  // namespace voxeld::test
