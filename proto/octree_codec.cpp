#include "proto/octree_codec.h"

#include <array>
#include <bit>
#include <string>

namespace voxeld {
namespace {

// Levels of a tile from the root (256 cells) to nodes of 2 cells, and the one whose nodes are
// bricks.
constexpr size_t kLevels = 8;
constexpr size_t kBrickLevel = 5;
static_assert(limits::kTileSide == 1 << kLevels);
static_assert(limits::kTileSide >> kBrickLevel == limits::kBrickSide);

Error broken(std::string detail) {
  return {ErrorCode::kBadRequest, "grid container, octree: " + std::move(detail), "", ""};
}

uint8_t byte_of(const BrickMask& mask, size_t node) {
  return static_cast<uint8_t>(mask.words[node / 8] >> (8 * (node % 8)));
}

// Nodes above the bricks: from the codes of one level's nodes, masks and codes of the level above.
void add_parents(const std::vector<uint32_t>& codes, std::vector<uint8_t>& masks,
                 std::vector<uint32_t>& parents) {
  for (const uint32_t code : codes) {
    if (parents.empty() || parents.back() != code >> 3) {
      parents.push_back(code >> 3);
      masks.push_back(0);
    }
    masks.back() = static_cast<uint8_t>(masks.back() | 1u << (code & 7));
  }
}

}  // namespace

std::vector<uint8_t> octree_from_bricks(const SparseTile& tile) {
  std::array<std::vector<uint8_t>, kLevels> levels;
  for (const BrickMask& mask : tile.masks) {
    uint32_t brick = 0;
    for (size_t i = 0; i < 8; ++i) {
      uint32_t node = 0;
      for (size_t j = 0; j < 8; ++j) {
        const uint8_t leaf = byte_of(mask, 8 * i + j);
        if (leaf == 0) continue;
        node |= 1u << j;
        levels[kBrickLevel + 2].push_back(leaf);
      }
      if (node == 0) continue;
      brick |= 1u << i;
      levels[kBrickLevel + 1].push_back(static_cast<uint8_t>(node));
    }
    levels[kBrickLevel].push_back(static_cast<uint8_t>(brick));
  }
  std::vector<uint32_t> codes = tile.brick_morton;
  for (size_t level = kBrickLevel; level-- > 0;) {
    std::vector<uint32_t> parents;
    add_parents(codes, levels[level], parents);
    codes = std::move(parents);
  }
  std::vector<uint8_t> octree;
  for (const auto& level : levels) octree.insert(octree.end(), level.begin(), level.end());
  return octree;
}

Status bricks_from_octree(std::span<const uint8_t> octree, SparseTile& tile) {
  std::array<std::span<const uint8_t>, kLevels> levels;
  size_t at = 0, count = 1;
  for (size_t level = 0; level < kLevels; ++level) {
    if (octree.size() - at < count) return broken("level " + std::to_string(level) + " is cut off");
    levels[level] = octree.subspan(at, count);
    at += count;
    count = 0;
    for (const uint8_t mask : levels[level]) {
      if (mask == 0) return broken("level " + std::to_string(level) + " has an empty node");
      count += static_cast<size_t>(std::popcount(mask));
    }
  }
  if (at != octree.size()) return broken("bytes after the last level");

  std::vector<uint32_t> codes = {0};
  for (size_t level = 0; level < kBrickLevel; ++level) {
    std::vector<uint32_t> children;
    for (size_t i = 0; i < codes.size(); ++i) {
      for (uint32_t bits = levels[level][i]; bits != 0; bits &= bits - 1) {
        children.push_back(codes[i] << 3 | static_cast<uint32_t>(std::countr_zero(bits)));
      }
    }
    codes = std::move(children);
  }
  tile.brick_morton = std::move(codes);
  tile.masks.assign(tile.brick_morton.size(), {});
  size_t node = 0, leaf = 0;
  for (size_t b = 0; b < tile.masks.size(); ++b) {
    for (uint32_t i_bits = levels[kBrickLevel][b]; i_bits != 0; i_bits &= i_bits - 1) {
      const auto i = static_cast<size_t>(std::countr_zero(i_bits));
      uint64_t& word = tile.masks[b].words[i];
      for (uint32_t j_bits = levels[kBrickLevel + 1][node++]; j_bits != 0; j_bits &= j_bits - 1) {
        word |= uint64_t{levels[kBrickLevel + 2][leaf++]} << (8 * std::countr_zero(j_bits));
      }
    }
  }
  return {};
}

}  // namespace voxeld
