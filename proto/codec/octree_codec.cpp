#include "proto/codec/octree_codec.h"

#include <algorithm>
#include <array>
#include <bit>
#include <string>
#include <utility>

#include "proto/codec/canonical_tile.h"
#include "proto/work_point.h"

namespace voxeld {
namespace {

// Levels of a tile from the root (256 cells) down to nodes of 2 cells.
constexpr size_t kLevels = 8;
// The level whose nodes are bricks.
constexpr size_t kBrickLevel = 5;
static_assert(limits::kTileSide == 1 << kLevels);
static_assert(limits::kTileSide >> kBrickLevel == limits::kBrickSide);
static_assert(kTileLevels == kBrickLevel);
constexpr uint8_t kFull = 0;  // the byte of a node that is full and has no children in the stream

Error broken_octree(std::string detail) {
  return {ErrorCode::kBadRequest, "grid container, octree: " + std::move(detail), "", ""};
}

uint8_t byte_of(const BrickMask& mask, size_t node) {
  return static_cast<uint8_t>(mask.words[node / 8] >> (8 * (node % 8)));
}

// The nodes of one level between the root and the bricks, in Morton order.
struct Nodes {
  std::vector<uint32_t> codes;
  std::vector<uint8_t> bytes;

  void add(uint32_t code, uint8_t byte) {
    codes.push_back(code);
    bytes.push_back(byte);
  }
};

Nodes parents_of(const Nodes& nodes) {
  Nodes parents;
  for (const uint32_t code : nodes.codes) {
    if (parents.codes.empty() || parents.codes.back() != code >> 3) parents.add(code >> 3, 0);
    uint8_t& mask = parents.bytes.back();
    mask = static_cast<uint8_t>(mask | 1u << (code & 7));
  }
  return parents;
}

// Adds the full nodes of this level, which are 2^full_level bricks on a side.
Nodes with_full(Nodes nodes, const std::vector<FullNode>& full, uint32_t full_level) {
  const auto of_level = [&](const FullNode& node) { return node.level == full_level; };
  if (std::ranges::none_of(full, of_level)) return nodes;
  Nodes all;
  size_t next = 0;
  for (const FullNode& node : full) {
    if (!of_level(node)) continue;
    const uint32_t code = node.brick_morton >> (3 * full_level);
    for (; next < nodes.codes.size() && nodes.codes[next] < code; ++next) {
      all.add(nodes.codes[next], nodes.bytes[next]);
    }
    all.add(code, kFull);
  }
  for (; next < nodes.codes.size(); ++next) all.add(nodes.codes[next], nodes.bytes[next]);
  return all;
}

using Levels = std::array<std::span<const uint8_t>, kLevels>;

// Finds where the levels begin: each has as many nodes as the level above has set bits.
Status cut_levels(std::span<const uint8_t> octree, Levels& levels) {
  size_t at = 0, count = 1;
  for (size_t level = 0; level < kLevels; ++level) {
    if (octree.size() - at < count)
      return broken_octree("level " + std::to_string(level) + " is cut off");
    levels[level] = octree.subspan(at, count);
    at += count;
    count = 0;
    for (const uint8_t mask : levels[level]) {
      if (mask == 0 && level > kBrickLevel) {
        return broken_octree("level " + std::to_string(level) + " has an empty node");
      }
      count += static_cast<size_t>(std::popcount(mask));
    }
  }
  if (at != octree.size()) return broken_octree("bytes after the last level");
  return {};
}

// The nodes of the next level. Full nodes go to `full` and have no children.
std::vector<uint32_t> children_of(const Levels& levels, size_t level,
                                  const std::vector<uint32_t>& codes, std::vector<FullNode>& full) {
  std::vector<uint32_t> children;
  children.reserve(levels[level + 1].size());
  const auto bricks_log2 = static_cast<uint32_t>(3 * (kBrickLevel - level));
  for (size_t i = 0; i < codes.size(); ++i) {
    const uint8_t mask = levels[level][i];
    if (mask == kFull) {
      full.push_back({codes[i] << bricks_log2, static_cast<uint32_t>(kBrickLevel - level)});
      continue;
    }
    for (uint32_t bits = mask; bits != 0; bits &= bits - 1) {
      children.push_back(codes[i] << 3 | static_cast<uint32_t>(std::countr_zero(bits)));
    }
  }
  return children;
}

// Adds the bricks `codes` as masks, or as full nodes.
void add_bricks(const Levels& levels, const std::vector<uint32_t>& codes, SparseTile& tile) {
  size_t node = 0, leaf = 0;
  for (size_t b = 0; b < codes.size(); ++b) {
    if (levels[kBrickLevel][b] == kFull) {
      tile.full.push_back({codes[b], 0});
      continue;
    }
    work_point();
    tile.brick_morton.push_back(codes[b]);
    BrickMask& mask = tile.masks.emplace_back();
    for (uint32_t i_bits = levels[kBrickLevel][b]; i_bits != 0; i_bits &= i_bits - 1) {
      uint64_t& word = mask.words[static_cast<size_t>(std::countr_zero(i_bits))];
      for (uint32_t j_bits = levels[kBrickLevel + 1][node++]; j_bits != 0; j_bits &= j_bits - 1) {
        word |= uint64_t{levels[kBrickLevel + 2][leaf++]} << (8 * std::countr_zero(j_bits));
      }
    }
  }
}

}  // namespace

std::vector<uint8_t> octree_from_tile(const SparseTile& tile) {
  std::array<std::vector<uint8_t>, kLevels> levels;
  Nodes nodes;
  nodes.codes = tile.brick_morton;
  for (const BrickMask& mask : tile.masks) {
    work_point();
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
    nodes.bytes.push_back(static_cast<uint8_t>(brick));
  }
  for (size_t level = kBrickLevel;; --level) {
    nodes = with_full(std::move(nodes), tile.full, static_cast<uint32_t>(kBrickLevel - level));
    levels[level] = nodes.bytes;
    if (level == 0) break;
    nodes = parents_of(nodes);
  }
  std::vector<uint8_t> octree;
  for (const auto& level : levels) octree.insert(octree.end(), level.begin(), level.end());
  return octree;
}

Result<OctreeCounts> count_octree(std::span<const uint8_t> octree) {
  Levels levels;
  VOXELD_TRY(cut_levels(octree, levels));
  OctreeCounts counts;
  for (size_t level = 0; level <= kBrickLevel; ++level) {
    const auto full = static_cast<uint64_t>(std::ranges::count(levels[level], kFull));
    counts.voxels += full << (3 * (kLevels - level));
    if (level == kBrickLevel) counts.bricks = levels[level].size() - full;
  }
  for (const uint8_t mask : levels[kLevels - 1]) {
    counts.mask_voxels += static_cast<uint64_t>(std::popcount(mask));
  }
  counts.voxels += counts.mask_voxels;
  return counts;
}

Status tile_from_octree(std::span<const uint8_t> octree, bool has_attributes, SparseTile& tile) {
  tile.brick_morton.clear();
  tile.masks.clear();
  tile.full.clear();
  Levels levels;
  VOXELD_TRY(cut_levels(octree, levels));
  std::vector<uint32_t> codes = {0};
  for (size_t level = 0; level < kBrickLevel; ++level) {
    codes = children_of(levels, level, codes, tile.full);
  }
  tile.brick_morton.reserve(codes.size());
  tile.masks.reserve(codes.size());
  add_bricks(levels, codes, tile);
  std::ranges::sort(tile.full, {}, &FullNode::brick_morton);
  if (!is_canonical(tile, has_attributes)) return broken_octree("a full node is spelled out");
  return {};
}

}  // namespace voxeld
