// One tile of a sparse grid as plain data. The voxelizer makes it, the container stores it, the
// renderer draws it and the client decodes it.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "proto/channels.h"
#include "proto/limits.h"

namespace voxeld {

// A mask of 8x8x8 voxels. Bit i of the 512 (bit i%64 of word i/64) is the voxel with Morton index i
// in the brick: i = spread(x) | spread(y)<<1 | spread(z)<<2 with x, y, z in 0..7. Byte j of the
// mask is therefore the child mask of the j-th 2x2x2 node in Morton order. The masks themselves are
// the octree's lowest level.
//
//   word  7      6      5      4      3      2      1      0
//        z4..7  z4..7  z4..7  z4..7  z0..3  z0..3  z0..3  z0..3
//        y4..7  y4..7  y0..3  y0..3  y4..7  y4..7  y0..3  y0..3
//        x4..7  x0..3  x4..7  x0..3  x4..7  x0..3  x4..7  x0..3
struct BrickMask {
  std::array<uint64_t, 8> words{};
  bool operator==(const BrickMask&) const = default;
};

// An octree node whose voxels are all occupied, 2^level bricks on a side. Its cost does not depend
// on its size, so the inside of a solid costs next to nothing.
struct FullNode {
  uint32_t brick_morton = 0;  // its first brick; a multiple of brick_count()
  uint32_t level = 0;         // 0: one brick, ... kTileLevels: the whole tile

  uint32_t brick_count() const { return uint32_t{1} << (3 * level); }
  bool operator==(const FullNode&) const = default;
};

// Levels from a brick up to the tile's root.
inline constexpr uint32_t kTileLevels =
    static_cast<uint32_t>(std::countr_zero(unsigned{limits::kTileSide / limits::kBrickSide}));

// A cube of kTileSide^3 voxels at cell coord*kTileSide of the grid. It holds only occupied bricks,
// in ascending Morton order of their position; bricks inside full nodes are not listed. Attributes
// are stored only for the voxels in `masks`, in Morton order of the tile. Voxels of full nodes have
// none.
//
// A set of voxels has exactly one canonical form (canonicalize()): full nodes are as large as
// possible, and without attributes no mask is full.
struct SparseTile {
  std::array<int32_t, 3> coord{};      // in tiles
  std::vector<uint32_t> brick_morton;  // ascending; < (kTileSide/kBrickSide)^3
  std::vector<BrickMask> masks;        // same length
  std::vector<FullNode> full;          // ascending; no overlap with another node or a mask
  // Each is empty, or has this many samples per voxel of `masks`:
  std::vector<uint8_t> color{};      // 4: sRGB R, G, B and linear A
  std::vector<int8_t> normal{};      // 3: unit normal times 127, rounded
  std::vector<uint16_t> material{};  // 1: id; 0: none
  std::vector<uint16_t> label{};     // 1: likewise
  std::vector<int16_t> distance{};   // 1: in 1/kDistanceSteps of distance_unit()
  std::vector<uint8_t> coverage{};   // 1: 255 is all of the voxel

  bool empty() const { return masks.empty() && full.empty(); }
  size_t voxel_count() const;      // of masks and full nodes
  size_t attribute_count() const;  // voxels of masks, which alone have attributes
  bool has_attributes() const;     // of any channel
  bool operator==(const SparseTile&) const = default;
};

// The samples of each channel, in the order of kChannels.
inline constexpr std::tuple kChannelSamples = {&SparseTile::color,    &SparseTile::normal,
                                               &SparseTile::material, &SparseTile::label,
                                               &SparseTile::distance, &SparseTile::coverage};
static_assert(std::tuple_size_v<decltype(kChannelSamples)> == kChannelCount);

// A channel as a constant, so that a visitor can choose types by the channel's kind.
template <Channel channel>
using ChannelConstant = std::integral_constant<Channel, channel>;
// The type of a member's samples.
template <typename Sample>
Sample sample_type(std::vector<Sample> SparseTile::*);
template <typename Member>
using SampleOf = decltype(sample_type(Member{}));

// Calls visit(ChannelConstant, member) for each channel in order; `member` points to its samples in
// a tile.
template <typename Visit>
constexpr void for_each_channel_member(Visit&& visit) {
  [&]<size_t... kIndex>(std::index_sequence<kIndex...>) {
    (visit(ChannelConstant<kChannels[kIndex].channel>{}, std::get<kIndex>(kChannelSamples)), ...);
  }
  (std::make_index_sequence<kChannelCount>{});
}
// Calls visit(ChannelConstant, member) for one channel.
template <typename Visit>
constexpr void with_channel_member(Channel channel, Visit&& visit) {
  for_each_channel_member([&](auto which, auto member) {
    if (which == channel) visit(which, member);
  });
}
static_assert([] {
  bool agree = true;
  for_each_channel_member([&](Channel channel, auto member) {
    agree = agree && channel_info(channel).sample_bytes == sizeof(SampleOf<decltype(member)>);
  });
  return agree;
}());

// Calls visit(channel, samples) with the tile's own vectors.
template <typename Tile, typename Visit>
void for_each_channel(Tile& tile, Visit&& visit) {
  for_each_channel_member([&](Channel channel, auto member) { visit(channel, tile.*member); });
}

// The samples of a channel of ids (ChannelInfo::is_id). Aborts for any other channel.
inline std::vector<uint16_t>& id_samples(SparseTile& tile, Channel channel) {
  std::vector<uint16_t>* samples = nullptr;
  with_channel_member(channel, [&](auto which, auto member) {
    if constexpr (channel_info(which).is_id()) samples = &(tile.*member);
  });
  if (samples == nullptr) std::abort();
  return *samples;
}
inline const std::vector<uint16_t>& id_samples(const SparseTile& tile, Channel channel) {
  return id_samples(const_cast<SparseTile&>(tile), channel);
}

// Reads or sets a channel's samples as little-endian bytes; `bytes` holds whole samples.
std::span<const uint8_t> channel_bytes(const SparseTile& tile, Channel channel);
void set_channel_bytes(SparseTile& tile, Channel channel, std::span<const uint8_t> bytes);
// Resizes every channel of `channels` to attribute_count(); new samples are 0.
void resize_channels(SparseTile& tile, const ChannelSet& channels);

// Moves full masks of a tile without attributes into `full`, and merges eight full nodes into a
// larger one if they complete it. Needs `full` in ascending order.
void canonicalize(SparseTile& tile);

// Interleaves the low 10 bits of each coordinate, x lowest.
constexpr uint32_t morton_spread(uint32_t v) {
  v &= 0x3ffu;
  v = (v | (v << 16)) & 0x030000ffu;
  v = (v | (v << 8)) & 0x0300f00fu;
  v = (v | (v << 4)) & 0x030c30c3u;
  v = (v | (v << 2)) & 0x09249249u;
  return v;
}
constexpr uint32_t morton_encode(uint32_t x, uint32_t y, uint32_t z) {
  return morton_spread(x) | (morton_spread(y) << 1) | (morton_spread(z) << 2);
}
constexpr uint32_t morton_compact(uint32_t v) {
  v &= 0x09249249u;
  v = (v | (v >> 2)) & 0x030c30c3u;
  v = (v | (v >> 4)) & 0x0300f00fu;
  v = (v | (v >> 8)) & 0x030000ffu;
  v = (v | (v >> 16)) & 0x3ffu;
  return v;
}
constexpr std::array<uint32_t, 3> morton_decode(uint32_t m) {
  return {morton_compact(m), morton_compact(m >> 1), morton_compact(m >> 2)};
}

// The voxel index that for_each_voxel() passes for a voxel in a full node.
inline constexpr size_t kNoAttributes = SIZE_MAX;

// Calls visit(brick_morton, mask, first_voxel) for every brick with voxels in Morton order, also
// for each brick of a full node. first_voxel: where the brick's attributes begin, or kNoAttributes.
template <typename Visit>
void for_each_brick(const SparseTile& tile, Visit&& visit) {
  BrickMask full_mask;
  full_mask.words.fill(~uint64_t{0});
  size_t next_full = 0, voxel_index = 0;
  const auto visit_full_before = [&](uint32_t end) {
    for (; next_full < tile.full.size() && tile.full[next_full].brick_morton < end; ++next_full) {
      const FullNode& node = tile.full[next_full];
      for (uint32_t i = 0; i < node.brick_count(); ++i) {
        visit(node.brick_morton + i, full_mask, kNoAttributes);
      }
    }
  };
  for (size_t b = 0; b < tile.masks.size(); ++b) {
    visit_full_before(tile.brick_morton[b]);
    visit(tile.brick_morton[b], tile.masks[b], voxel_index);
    for (const uint64_t word : tile.masks[b].words) {
      voxel_index += static_cast<size_t>(std::popcount(word));
    }
  }
  visit_full_before(UINT32_MAX);
}

// Calls visit(x, y, z, voxel_index) for every occupied voxel in Morton order. x, y, z are cells of
// the grid. voxel_index counts the tile's voxels with attributes, or is kNoAttributes.
template <typename Visit>
void for_each_voxel(const SparseTile& tile, Visit&& visit) {
  for_each_brick(tile, [&](uint32_t morton, const BrickMask& mask, size_t voxel_index) {
    const auto brick = morton_decode(morton);
    const std::array<int32_t, 3> base = {
        tile.coord[0] * limits::kTileSide + static_cast<int32_t>(brick[0]) * limits::kBrickSide,
        tile.coord[1] * limits::kTileSide + static_cast<int32_t>(brick[1]) * limits::kBrickSide,
        tile.coord[2] * limits::kTileSide + static_cast<int32_t>(brick[2]) * limits::kBrickSide};
    for (uint32_t word = 0; word < 8; ++word) {
      for (uint64_t bits = mask.words[word]; bits != 0; bits &= bits - 1) {
        const auto cell = morton_decode(word * 64 + static_cast<uint32_t>(std::countr_zero(bits)));
        visit(base[0] + static_cast<int32_t>(cell[0]), base[1] + static_cast<int32_t>(cell[1]),
              base[2] + static_cast<int32_t>(cell[2]), voxel_index);
        if (voxel_index != kNoAttributes) ++voxel_index;
      }
    }
  });
}

}  // namespace voxeld
