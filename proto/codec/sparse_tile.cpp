#include "proto/codec/sparse_tile.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <span>
#include <utility>

#include "proto/codec/canonical_tile.h"

namespace voxeld {
namespace {

constexpr size_t kBrickVoxels =
    size_t{limits::kBrickSide} * limits::kBrickSide * limits::kBrickSide;

// Appends a node, then merges for as long as eight of one size complete a larger one.
void push_full(std::vector<FullNode>& nodes, FullNode node) {
  nodes.push_back(node);
  for (;;) {
    const FullNode last = nodes.back();
    const uint32_t parent_bricks = last.brick_count() * 8;
    if (last.level == kTileLevels || nodes.size() < 8) return;
    const std::span<const FullNode> eight = std::span(nodes).last(8);
    const FullNode first = eight.front();
    if (first.brick_morton % parent_bricks != 0 ||
        last.brick_morton - first.brick_morton != 7 * last.brick_count() ||
        !std::ranges::all_of(eight, [&](const FullNode& n) { return n.level == last.level; })) {
      return;
    }
    const FullNode parent = {first.brick_morton, last.level + 1};
    nodes.resize(nodes.size() - 8);
    nodes.push_back(parent);
  }
}

}  // namespace

size_t SparseTile::attribute_count() const {
  size_t count = 0;
  for (const BrickMask& mask : masks) {
    for (const uint64_t word : mask.words) count += static_cast<size_t>(std::popcount(word));
  }
  return count;
}

size_t SparseTile::voxel_count() const {
  size_t count = attribute_count();
  for (const FullNode& node : full) count += node.brick_count() * kBrickVoxels;
  return count;
}

bool SparseTile::has_attributes() const {
  bool any = false;
  for_each_channel(*this, [&](Channel, const auto& samples) { any = any || !samples.empty(); });
  return any;
}

std::span<const uint8_t> channel_bytes(const SparseTile& tile, Channel channel) {
  static_assert(std::endian::native == std::endian::little, "channels are stored as they are");
  std::span<const uint8_t> bytes;
  with_channel_member(channel, [&](Channel, auto member) {
    const auto& samples = tile.*member;
    bytes = {reinterpret_cast<const uint8_t*>(samples.data()), samples.size() * sizeof samples[0]};
  });
  return bytes;
}

void set_channel_bytes(SparseTile& tile, Channel channel, std::span<const uint8_t> bytes) {
  with_channel_member(channel, [&](Channel, auto member) {
    auto& samples = tile.*member;
    samples.resize(bytes.size() / sizeof samples[0]);
    if (!samples.empty()) std::memcpy(samples.data(), bytes.data(), bytes.size());
  });
}

void resize_channels(SparseTile& tile, const ChannelSet& channels) {
  const size_t voxels = tile.attribute_count();
  for_each_channel(tile, [&](Channel channel, auto& samples) {
    if (channels.has(channel)) samples.resize(voxels * channel_info(channel).components);
  });
}

void canonicalize(SparseTile& tile) {
  if (tile.has_attributes()) {
    std::vector<FullNode> joined;
    for (const FullNode& node : tile.full) push_full(joined, node);
    tile.full = std::move(joined);
    return;
  }
  if (tile.full.empty() && std::ranges::none_of(tile.masks, is_full)) return;
  std::vector<FullNode> joined;
  size_t kept = 0, next_full = 0;
  for (size_t b = 0; b < tile.masks.size(); ++b) {
    for (; next_full < tile.full.size() && tile.full[next_full].brick_morton < tile.brick_morton[b];
         ++next_full) {
      push_full(joined, tile.full[next_full]);
    }
    if (is_full(tile.masks[b])) {
      push_full(joined, {tile.brick_morton[b], 0});
      continue;
    }
    tile.brick_morton[kept] = tile.brick_morton[b];
    tile.masks[kept++] = tile.masks[b];
  }
  for (; next_full < tile.full.size(); ++next_full) push_full(joined, tile.full[next_full]);
  tile.brick_morton.resize(kept);
  tile.masks.resize(kept);
  tile.full = std::move(joined);
}

}  // namespace voxeld
