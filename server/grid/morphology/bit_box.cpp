#include "server/grid/morphology/bit_box.h"

#include <algorithm>
#include <bit>

#include "proto/limits.h"
#include "server/base/cancel_point.h"
#include "server/base/check.h"

namespace voxeld {
namespace {

constexpr uint32_t kBricksPerTile = uint32_t{1} << (3 * kTileLevels);

// A row of a brick in its mask: the bits of its eight cells lie in pairs, in two words.
struct BrickRow {
  size_t low, high;  // words of cells 0 to 3 and 4 to 7
  uint32_t shift;    // of cell 0; cells 2 and 3 are 8 bits further

  BrickRow(int y, int z) {
    const uint32_t code = morton_encode(0, static_cast<uint32_t>(y), static_cast<uint32_t>(z));
    low = code / 64;
    high = low + 1;
    shift = code % 64;
  }
  uint64_t get(const BrickMask& mask) const {
    const auto half = [&](uint64_t word) {
      word >>= shift;
      return (word & 3) | (word >> 8 & 3) << 2;
    };
    return half(mask.words[low]) | half(mask.words[high]) << 4;
  }
  void set(BrickMask& mask, uint64_t cells) const {
    const auto half = [&](uint64_t four) { return ((four & 3) | (four >> 2 & 3) << 8) << shift; };
    mask.words[low] |= half(cells);
    mask.words[high] |= half(cells >> 4);
  }
};

}  // namespace

BitBox::BitBox(const CellBox& cells)
    : cells_(cells), words_((cells.max.x - cells.min.x) / kWordCells) {
  VOXELD_CHECK((cells.max.x - cells.min.x) % kWordCells == 0 && cells.min.x % kWordCells == 0,
               "rows of bits are whole words");
  const auto rows = static_cast<size_t>(cells.max.y - cells.min.y);
  bits_.resize(rows * static_cast<size_t>(cells.max.z - cells.min.z) * static_cast<size_t>(words_));
}

void BitBox::mark(const SparseTile& tile) {
  const glm::ivec3 tile_first = first_cell_of(tile.coord);
  for_each_brick(tile, [&](uint32_t morton, const BrickMask& mask, size_t) {
    cancel_point();
    const auto at = morton_decode(morton);
    const glm::ivec3 first = tile_first + limits::kBrickSide * glm::ivec3(at[0], at[1], at[2]);
    if (first.x < cells_.min.x || first.x >= cells_.max.x) return;
    const int x = first.x - cells_.min.x;
    for (int z = 0; z < limits::kBrickSide; ++z) {
      for (int y = 0; y < limits::kBrickSide; ++y) {
        if (!has_row(first.y + y, first.z + z)) continue;
        const uint64_t cells = BrickRow(y, z).get(mask);
        row(first.y + y, first.z + z)[x / kWordCells] |= cells << (x % kWordCells);
      }
    }
  });
}

BrickMask BitBox::brick(const glm::ivec3& first) const {
  BrickMask mask;
  const int x = first.x - cells_.min.x;
  for (int z = 0; z < limits::kBrickSide; ++z) {
    for (int y = 0; y < limits::kBrickSide; ++y) {
      if (!has_row(first.y + y, first.z + z)) continue;
      const uint64_t word = row(first.y + y, first.z + z)[x / kWordCells];
      BrickRow(y, z).set(mask, word >> (x % kWordCells) & 0xff);
    }
  }
  return mask;
}

VoxelLookup::VoxelLookup(const SparseTile& tile) : tile_(&tile) {
  size_t count = 0;
  firsts_.reserve(tile.masks.size());
  for (const BrickMask& mask : tile.masks) {
    firsts_.push_back(count);
    for (const uint64_t word : mask.words) count += static_cast<size_t>(std::popcount(word));
  }
}

VoxelValues VoxelLookup::at(uint32_t code) const {
  const auto& bricks = tile_->brick_morton;
  const auto found = std::lower_bound(bricks.begin(), bricks.end(), code >> 9);
  if (found == bricks.end() || *found != code >> 9) return {};
  const auto brick = static_cast<size_t>(found - bricks.begin());
  const BrickMask& mask = tile_->masks[brick];
  const uint32_t word = code >> 6 & 7;
  size_t voxel = firsts_[brick];
  for (uint32_t i = 0; i < word; ++i) {
    voxel += static_cast<size_t>(std::popcount(mask.words[i]));
  }
  const uint64_t below = (uint64_t{1} << (code & 63)) - 1;
  return values_of(*tile_, voxel + static_cast<size_t>(std::popcount(mask.words[word] & below)));
}

glm::ivec3 first_cell_of(const TileCoord& coord) {
  return glm::ivec3(coord[0], coord[1], coord[2]) * limits::kTileSide;
}

SparseTile tile_of_bits(const TileCoord& coord, const BitBox& bits, const ChannelSet& channels,
                        const std::function<VoxelValues(uint32_t code)>& values) {
  const glm::ivec3 first = first_cell_of(coord);
  SparseTile plain;
  plain.coord = coord;
  TileAppender out(coord, channels);
  for (uint32_t brick = 0; brick < kBricksPerTile; ++brick) {
    const auto at = morton_decode(brick);
    const glm::ivec3 cell = first + limits::kBrickSide * glm::ivec3(at[0], at[1], at[2]);
    if (!bits.has_row(cell.y, cell.z)) continue;
    const BrickMask mask = bits.brick(cell);
    if (mask == BrickMask{}) continue;
    cancel_point();
    if (!channels.any()) {
      plain.brick_morton.push_back(brick);
      plain.masks.push_back(mask);
      continue;
    }
    for (uint32_t word = 0; word < mask.words.size(); ++word) {
      for (uint64_t rest = mask.words[word]; rest != 0; rest &= rest - 1) {
        const auto bit = static_cast<uint32_t>(std::countr_zero(rest));
        const uint32_t code = brick << 9 | word << 6 | bit;
        out.add(code, values(code));
      }
    }
  }
  if (channels.any()) return out.finish();
  canonicalize(plain);
  return plain;
}

}  // namespace voxeld
