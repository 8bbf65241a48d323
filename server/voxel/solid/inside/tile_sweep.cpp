#include "server/voxel/solid/inside/tile_sweep.h"

#include <algorithm>
#include <cstring>

#include "server/base/pieces.h"

namespace voxeld {
namespace {

constexpr uint32_t crossing_u(Crossing c) {
  return c & 0xffu;
}
constexpr uint32_t crossing_v(Crossing c) {
  return c >> 8 & 0xffu;
}

constexpr size_t row_of(int brick_y, int brick_z) {
  return static_cast<size_t>(brick_z) * kTileBricks + static_cast<size_t>(brick_y);
}

// Bit i of the result is the XOR of bits 0 to i.
constexpr uint64_t prefix_xor(uint64_t word) {
  for (int shift = 1; shift < 64; shift *= 2) word ^= word << shift;
  return word;
}

}  // namespace

int SweepZ::uniform() const {
  const uint64_t first = carry_.front();
  if (first != 0 && first != ~uint64_t{0}) return -1;
  if (!std::ranges::all_of(carry_, [&](uint64_t word) { return word == first; })) return -1;
  return first == 0 ? 0 : 1;
}

void SweepZ::toggle(std::span<const Crossing> crossings, int v_offset, int base) {
  for_each_in_pieces(crossings, [&](Crossing c) {
    volume_.toggle(crossing_u(c), crossing_v(c) + static_cast<uint32_t>(v_offset),
                   static_cast<uint32_t>(crossing_cell(c) - base));
  });
}

void SweepZ::next_row(int brick_y, int brick_z, BrickRow& rows) {
  uint64_t* carry = &carry_[static_cast<size_t>(brick_y) * kBlockPlaneWords];
  const size_t row = row_of(brick_y, brick_z);
  if (!volume_.used(row)) {
    for (size_t z = 0; z < limits::kBrickSide; ++z) {
      std::memcpy(&rows[z * kBlockPlaneWords], carry, kBlockPlaneWords * sizeof(uint64_t));
    }
    return;
  }
  const uint64_t* toggles = volume_.row(row);
  for (size_t z = 0; z < limits::kBrickSide; ++z) {
    for (size_t i = 0; i < kBlockPlaneWords; ++i) {
      carry[i] ^= toggles[z * kBlockPlaneWords + i];
      rows[z * kBlockPlaneWords + i] = carry[i];
    }
  }
  volume_.clear(row);
}

void SweepX::begin_tile(std::span<const Crossing> below, std::span<const Crossing> in_tile,
                        int base) {
  entry_.fill(0);
  for_each_in_pieces(
      below, [&](Crossing c) { entry_[crossing_v(c) * limits::kTileSide + crossing_u(c)] ^= 1; });
  for_each_in_pieces(in_tile, [&](Crossing c) {
    volume_.toggle(static_cast<uint32_t>(crossing_cell(c) - base), crossing_u(c), crossing_v(c));
  });
}

void SweepX::next_row(int brick_y, int brick_z, BrickRow& rows) {
  const size_t row = row_of(brick_y, brick_z);
  const bool used = volume_.used(row);
  const uint64_t* toggles = volume_.row(row);
  for (size_t z = 0; z < limits::kBrickSide; ++z) {
    for (size_t y = 0; y < limits::kBrickSide; ++y) {
      const size_t entry = (static_cast<size_t>(brick_z) * 8 + z) * limits::kTileSide +
                           static_cast<size_t>(brick_y) * 8 + y;
      uint64_t carry = entry_[entry] != 0 ? ~uint64_t{0} : 0;
      for (size_t w = 0; w < kBlockRowWords; ++w) {
        const size_t i = (z * 8 + y) * kBlockRowWords + w;
        rows[i] = used ? prefix_xor(toggles[i]) ^ carry : carry;
        carry = (rows[i] >> 63) != 0 ? ~uint64_t{0} : 0;
      }
    }
  }
  volume_.clear(row);
}

void SweepY::begin_tile(std::span<const Crossing> below, std::span<const Crossing> in_tile,
                        int base) {
  carry_.fill(0);
  for_each_in_pieces(below, [&](Crossing c) {
    carry_[crossing_u(c) * kBlockRowWords + (crossing_v(c) >> 6)] ^= uint64_t{1}
                                                                     << (crossing_v(c) & 63);
  });
  for_each_in_pieces(in_tile, [&](Crossing c) {
    volume_.toggle(crossing_v(c), static_cast<uint32_t>(crossing_cell(c) - base), crossing_u(c));
  });
}

void SweepY::next_row(int brick_y, int brick_z, BrickRow& rows) {
  const size_t row = row_of(brick_y, brick_z);
  const uint64_t* toggles = volume_.row(row);
  for (size_t z = 0; z < limits::kBrickSide; ++z) {
    uint64_t* carry = &carry_[(static_cast<size_t>(brick_z) * 8 + z) * kBlockRowWords];
    for (size_t y = 0; y < limits::kBrickSide; ++y) {
      for (size_t w = 0; w < kBlockRowWords; ++w) {
        const size_t i = (z * 8 + y) * kBlockRowWords + w;
        carry[w] ^= toggles[i];
        rows[i] = carry[w];
      }
    }
  }
  volume_.clear(row);
}

void trim(const TileExtent& extent, int brick_y, int brick_z, BrickRow& rows) {
  if (extent.size[0] == limits::kTileSide && extent.size[1] >= (brick_y + 1) * limits::kBrickSide &&
      extent.size[2] >= (brick_z + 1) * limits::kBrickSide) {
    return;
  }
  for (int z = 0; z < limits::kBrickSide; ++z) {
    for (int y = 0; y < limits::kBrickSide; ++y) {
      const bool inside = brick_z * limits::kBrickSide + z < extent.size[2] &&
                          brick_y * limits::kBrickSide + y < extent.size[1];
      const size_t row = static_cast<size_t>(z) * 8 + static_cast<size_t>(y);
      for (size_t w = 0; w < kBlockRowWords; ++w) {
        const int cells = inside ? std::clamp(extent.size[0] - 64 * static_cast<int>(w), 0, 64) : 0;
        const uint64_t kept = cells == 64 ? ~uint64_t{0} : (uint64_t{1} << cells) - 1;
        rows[row * kBlockRowWords + w] &= kept;
      }
    }
  }
}

}  // namespace voxeld
