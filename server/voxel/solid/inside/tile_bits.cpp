#include "server/voxel/solid/inside/tile_bits.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace voxeld {
namespace {

static_assert(std::endian::native == std::endian::little, "rows are words and bytes");

// Spreads bits of x over a word of 4x4x4 cells in Morton order, where x has index bits 0 and 3.
constexpr std::array<uint64_t, 16> spread_table() {
  std::array<uint64_t, 16> table{};
  for (uint64_t bits = 0; bits < 16; ++bits) {
    table[bits] = (bits & 3) | (bits & 12) << 6;
  }
  return table;
}
constexpr std::array<uint64_t, 16> kSpread = spread_table();
// y has index bits 1 and 4, z has 2 and 5.
constexpr std::array<int, 4> kPlaceY = {0, 2, 16, 18};
constexpr std::array<int, 4> kPlaceZ = {0, 4, 32, 36};

// Two bytes for each brick of the row: nonzero `any` if any cell is set, all ones in `all` if every
// cell is.
struct RowSummary {
  std::array<uint64_t, kBlockRowWords> any{}, all{};
};

RowSummary summarize(const BrickRow& rows) {
  RowSummary summary;
  summary.all.fill(~uint64_t{0});
  for (size_t i = 0; i < kBrickRowWords; i += kBlockRowWords) {
    for (size_t w = 0; w < kBlockRowWords; ++w) {
      summary.any[w] |= rows[i + w];
      summary.all[w] &= rows[i + w];
    }
  }
  return summary;
}

}  // namespace

BrickMask brick_of_row(const BrickRow& rows, int brick_x) {
  BrickMask mask;
  const auto* row = reinterpret_cast<const uint8_t*>(rows.data()) + brick_x;
  for (size_t octant = 0; octant < 8; octant += 2) {
    const size_t y_first = (octant & 2) * 2, z_first = (octant & 4);
    uint64_t low = 0, high = 0;
    for (size_t z = 0; z < 4; ++z) {
      for (size_t y = 0; y < 4; ++y) {
        const uint8_t cells = row[((z_first + z) * 8 + y_first + y) * kRowBytes];
        const int place = kPlaceY[y] + kPlaceZ[z];
        low |= kSpread[cells & 15] << place;
        high |= kSpread[cells >> 4] << place;
      }
    }
    mask.words[octant] = low;
    mask.words[octant + 1] = high;
  }
  return mask;
}

void ToggleVolume::clear(size_t row) {
  if (!used_[row]) return;
  used_[row] = false;
  std::memset(words_.data() + row * kBrickRowWords, 0, kBrickRowWords * sizeof(uint64_t));
}

void TileBits::add_row(size_t lane_index, int brick_y, int brick_z, const BrickRow& rows) {
  const RowSummary summary = summarize(rows);
  if ((summary.any[0] | summary.any[1] | summary.any[2] | summary.any[3]) == 0) return;
  Lane& lane = lanes_[lane_index];
  lane.used = true;
  const uint32_t row_morton =
      morton_encode(0, static_cast<uint32_t>(brick_y), static_cast<uint32_t>(brick_z));
  for (int x = 0; x < kTileBricks; ++x) {
    const size_t word = static_cast<size_t>(x) / 8;
    const int shift = x % 8 * 8;
    if ((summary.any[word] >> shift & 0xff) == 0) continue;
    const uint32_t morton = row_morton | morton_spread(static_cast<uint32_t>(x));
    if ((summary.all[word] >> shift & 0xff) == 0xff) {
      states_[morton] = kFull;
      continue;
    }
    states_[morton] = kMixed;
    places_[morton] = static_cast<uint32_t>(lane_index << 24 | lane.masks.size());
    lane.masks.push_back(brick_of_row(rows, x));
  }
}

void TileBits::move_to(SparseTile& tile) {
  const bool used = std::ranges::any_of(lanes_, &Lane::used);
  if (!used) return;
  size_t mixed = 0;
  for (const Lane& lane : lanes_) mixed += lane.masks.size();
  tile.brick_morton.reserve(tile.brick_morton.size() + mixed);
  tile.masks.reserve(tile.masks.size() + mixed);
  for (uint32_t first = 0; first < kTileBrickCount; first += 8) {
    uint64_t eight = 0;
    std::memcpy(&eight, &states_[first], 8);
    if (eight == 0) continue;
    if (eight == 0x0101010101010101ull * kFull) {
      tile.full.push_back({first, 1});
      continue;
    }
    for (uint32_t brick = first; brick < first + 8; ++brick) {
      if (states_[brick] == kFull) tile.full.push_back({brick, 0});
      if (states_[brick] != kMixed) continue;
      tile.brick_morton.push_back(brick);
      tile.masks.push_back(lanes_[places_[brick] >> 24].masks[places_[brick] & 0xffffff]);
    }
  }
  std::ranges::fill(states_, uint8_t{kEmpty});
  for (Lane& lane : lanes_) {
    lane.masks.clear();
    lane.used = false;
  }
  canonicalize(tile);
}

}  // namespace voxeld
