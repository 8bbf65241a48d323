#include "proto/codec/canonical_tile.h"

#include <algorithm>
#include <span>

namespace voxeld {
namespace {

constexpr uint32_t kTileBricks = uint32_t{1} << (3 * kTileLevels);

// Whether eight nodes of one size fill the next larger one.
bool makes_a_parent(std::span<const FullNode> eight) {
  const FullNode first = eight.front();
  return first.level < kTileLevels && first.brick_morton % (8 * first.brick_count()) == 0 &&
         eight.back().brick_morton - first.brick_morton == 7 * first.brick_count() &&
         std::ranges::all_of(eight, [&](const FullNode& n) { return n.level == first.level; });
}

}  // namespace

bool is_full(const BrickMask& mask) {
  return std::ranges::all_of(mask.words, [](uint64_t word) { return word == ~uint64_t{0}; });
}

bool is_canonical(const SparseTile& tile, bool has_attributes) {
  const std::span<const FullNode> full = tile.full;
  for (size_t i = 0; i + 8 <= full.size(); ++i) {
    if (makes_a_parent(full.subspan(i, 8))) return false;
  }
  return has_attributes || std::ranges::none_of(tile.masks, is_full);
}

const SparseTile& canonical_form(const SparseTile& tile, SparseTile& copy) {
  if (is_canonical(tile, tile.has_attributes())) return tile;
  copy = tile;
  canonicalize(copy);
  return copy;
}

bool full_nodes_are_apart(const SparseTile& tile) {
  uint32_t free_from = 0;  // the first brick that the next node may cover
  auto brick = tile.brick_morton.begin();
  for (const FullNode& node : tile.full) {
    if (node.level > kTileLevels || node.brick_morton >= kTileBricks ||
        node.brick_morton % node.brick_count() != 0 || node.brick_morton < free_from) {
      return false;
    }
    free_from = node.brick_morton + node.brick_count();
    brick = std::lower_bound(brick, tile.brick_morton.end(), node.brick_morton);
    if (brick != tile.brick_morton.end() && *brick < free_from) return false;
  }
  return true;
}

}  // namespace voxeld
