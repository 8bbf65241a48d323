#include "server/voxel/gl/occupancy/mask_bricks.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <vector>

#include "server/base/check.h"

namespace voxeld {
namespace {

static_assert(std::endian::native == std::endian::little, "bricks are words of 64 and of 32 bits");

constexpr size_t kBlockBricks = kTileMaskBricks / 64;
// Fewer blocks are done before another thread has woken up.
constexpr size_t kBlockGrain = 4;

bool is_empty(const BrickMask& brick) {
  uint64_t any = 0;
  for (const uint64_t word : brick.words) any |= word;
  return any == 0;
}

}  // namespace

// Without a branch, because a branch on occupancy would be unpredictable.
void MaskBricks::find(std::span<const BrickMask> masks, size_t index) {
  Block& block = blocks_[index];
  uint32_t* const begin = found_.data() + index * kBlockBricks;
  uint32_t* next = begin;
  for (size_t brick = block.first; brick < block.first + kBlockBricks; ++brick) {
    *next = static_cast<uint32_t>(brick);
    next += is_empty(masks[brick]) ? 0 : 1;
  }
  block.count = static_cast<size_t>(next - begin);
}

void MaskBricks::take(std::span<BrickMask> masks, std::span<const uint64_t> blocks,
                      ThreadTeam& team, std::span<SparseTile> tiles) {
  VOXELD_CHECK(masks.size() >= blocks.size() * kTileMaskBricks && tiles.size() == blocks.size(),
               "a mask and a tile for each");
  blocks_.clear();
  for (size_t slot = 0; slot < blocks.size(); ++slot) {
    for (uint64_t rest = blocks[slot]; rest != 0; rest &= rest - 1) {
      const auto number = static_cast<size_t>(std::countr_zero(rest));
      blocks_.push_back({slot, slot * kTileMaskBricks + number * kBlockBricks});
    }
  }
  found_.resize(blocks_.size() * kBlockBricks);
  const size_t parts =
      std::clamp<size_t>(blocks_.size() / kBlockGrain, 1, static_cast<size_t>(team.threads()));
  const auto bound = [&](int part) { return blocks_.size() * static_cast<size_t>(part) / parts; };
  team.run(static_cast<int>(parts), [&](int part) {
    for (size_t i = bound(part); i < bound(part + 1); ++i) find(masks, i);
  });
  for (size_t i = 0; i < blocks_.size();) {
    const size_t slot = blocks_[i].slot;
    size_t place = tiles[slot].masks.size();
    for (; i < blocks_.size() && blocks_[i].slot == slot; ++i) {
      blocks_[i].place = place;
      place += blocks_[i].count;
    }
    tiles[slot].brick_morton.resize(place);
    tiles[slot].masks.resize(place);
  }
  team.run(static_cast<int>(parts), [&](int part) {
    for (size_t i = bound(part); i < bound(part + 1); ++i) {
      const Block& block = blocks_[i];
      SparseTile& tile = tiles[block.slot];
      for (size_t n = 0; n < block.count; ++n) {
        const uint32_t brick = found_[i * kBlockBricks + n];
        tile.brick_morton[block.place + n] = brick % kTileMaskBricks;
        tile.masks[block.place + n] = masks[brick];
        masks[brick] = {};
      }
    }
  });
}

}  // namespace voxeld
