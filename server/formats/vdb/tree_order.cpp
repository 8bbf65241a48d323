#include "server/formats/vdb/tree_order.h"

#include <algorithm>
#include <tuple>

#include "proto/codec/tile_runs.h"
#include "server/base/cancel_point.h"

namespace voxeld::vdb {
namespace {

constexpr uint32_t kOctantLevel = kTileLevels - 1;
constexpr uint32_t kOctantBricks = uint32_t{1} << (3 * kOctantLevel);
constexpr size_t kOctants = 8;
static_assert(2 * kLowerSide == limits::kTileSide && kLeafSide == limits::kBrickSide);

constexpr std::array<uint16_t, LeafMask::kBits> kLeafBits = [] {
  std::array<uint16_t, LeafMask::kBits> bits{};
  for (uint32_t morton = 0; morton < bits.size(); ++morton) {
    const auto at = morton_decode(morton);
    bits[morton] = static_cast<uint16_t>(LeafMask::bit(at[0], at[1], at[2]));
  }
  return bits;
}();

// The bit of a lower node's masks. brick_morton: in the tile.
size_t lower_slot(uint32_t brick_morton) {
  const auto at = morton_decode(brick_morton % kOctantBricks);
  return LowerMask::bit(at[0], at[1], at[2]);
}

size_t voxel_count_of(const BrickMask& mask) {
  size_t voxels = 0;
  for (const uint64_t word : mask.words) voxels += static_cast<size_t>(std::popcount(word));
  return voxels;
}

Cell upper_cell(const Cell& cell) {
  Cell first{};
  for (size_t c = 0; c < 3; ++c) first[c] = cell[c] / kUpperSide * kUpperSide;
  return first;
}

}  // namespace

size_t leaf_bit(size_t morton) {
  return kLeafBits[morton];
}

LeafMask leaf_mask(const BrickMask& mask) {
  LeafMask bits;
  for (size_t w = 0; w < mask.words.size(); ++w) {
    if (mask.words[w] == ~uint64_t{0}) {  // 4x4x4 cells, as inside of solids
      for (size_t i = 0; i < 64; i += 8) {
        for (const size_t k : {0, 1, 2, 3, 4, 5, 6, 7}) bits.set(kLeafBits[64 * w + i + k]);
      }
      continue;
    }
    for (uint64_t word = mask.words[w]; word != 0; word &= word - 1) {
      bits.set(kLeafBits[64 * w + static_cast<size_t>(std::countr_zero(word))]);
    }
  }
  return bits;
}

std::vector<LeafPlace> LowerPlace::leaves() const {
  std::vector<LeafPlace> places;
  places.reserve(mask_end - mask_begin);
  size_t next = attribute;
  for (size_t i = mask_begin; i < mask_end; ++i) {
    places.push_back({lower_slot(tile->brick_morton[i]), &tile->masks[i], next});
    next += voxel_count_of(tile->masks[i]);
  }
  std::ranges::sort(places, {}, &LeafPlace::slot);
  return places;
}

LowerMask LowerPlace::full_bricks() const {
  LowerMask bricks;
  if (is_full) {
    bricks.words.fill(~uint64_t{0});
    return bricks;
  }
  for (size_t i = full_begin; i < full_end; ++i) {
    const FullNode& node = tile->full[i];
    for (uint32_t b = 0; b < node.brick_count(); ++b) {
      bricks.set(lower_slot(node.brick_morton + b));
    }
  }
  return bricks;
}

TreeOrder::TreeOrder(const Grid& grid) : grid_(grid) {
  for (const SparseTile& tile : grid.tiles) {
    cancel_point();
    add_tile(tile);
  }
  std::ranges::sort(lowers_, {}, [](const LowerPlace& lower) {
    return std::tuple(upper_cell(lower.cell), lower.slot);
  });
  for (size_t i = 0; i < lowers_.size(); ++i) {
    const Cell cell = upper_cell(lowers_[i].cell);
    if (uppers_.empty() || uppers_.back().cell != cell) uppers_.push_back({cell, i, i});
    uppers_.back().end = i + 1;
  }
}

void TreeOrder::add_tile(const SparseTile& tile) {
  size_t mask = 0, full = 0, attribute = 0;
  const bool is_full = !tile.full.empty() && tile.full.front().level == kTileLevels;
  for (uint32_t octant = 0; octant < kOctants; ++octant) {
    LowerPlace lower;
    lower.tile = &tile;
    lower.cell = brick_cell(tile, octant * kOctantBricks);
    Cell entry{};
    for (size_t c = 0; c < 3; ++c) entry[c] = lower.cell[c] % kUpperSide / kLowerSide;
    lower.slot = UpperMask::bit(static_cast<size_t>(entry[0]), static_cast<size_t>(entry[1]),
                                static_cast<size_t>(entry[2]));
    const uint32_t end = (octant + 1) * kOctantBricks;
    lower.mask_begin = mask;
    lower.attribute = attribute;
    for (; mask < tile.masks.size() && tile.brick_morton[mask] < end; ++mask) {
      attribute += voxel_count_of(tile.masks[mask]);
    }
    lower.mask_end = mask;
    lower.full_begin = full;
    while (full < tile.full.size() && tile.full[full].brick_morton < end) ++full;
    lower.full_end = full;
    lower.is_full = is_full || (lower.full_begin < lower.full_end &&
                                tile.full[lower.full_begin].level == kOctantLevel);
    if (lower.is_full || lower.mask_begin < mask || lower.full_begin < full) {
      lowers_.push_back(lower);
    }
  }
}

Cell TreeOrder::sides_within(const Cell& node_cell, int32_t entry_side) const {
  Cell sides{};
  for (size_t c = 0; c < 3; ++c) {
    const int32_t cells = grid_.spec.dims[static_cast<int>(c)] - node_cell[c];
    sides[c] = std::max(0, (cells + entry_side - 1) / entry_side);
  }
  return sides;
}

}  // namespace voxeld::vdb
