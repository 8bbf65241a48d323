#include "server/grid/content_hash.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/codec/canonical_tile.h"
#include "server/base/cancel_point.h"
#include "server/base/pieces.h"

namespace voxeld {
namespace {

// Stands in place of the next tile's coord, which is never negative.
constexpr int32_t kFullNodesFollow = -1;

template <typename T>
std::span<const uint8_t> bytes_of(const T* data, size_t count) {
  static_assert(std::endian::native == std::endian::little, "hashes are of little-endian bytes");
  return {reinterpret_cast<const uint8_t*>(data), count * sizeof(T)};
}

void hash_in_pieces(Sha256& hash, std::span<const uint8_t> bytes) {
  in_pieces(bytes.size(), kPieceElements<uint8_t>,
            [&](size_t begin, size_t end) { hash.update(bytes.subspan(begin, end - begin)); });
}

void hash_tile(const SparseTile& tile, Sha256& hash) {
  hash.update(bytes_of(tile.coord.data(), tile.coord.size()));
  const uint64_t bricks = tile.masks.size();
  hash.update(bytes_of(&bricks, 1));
  hash.update(bytes_of(tile.brick_morton.data(), tile.brick_morton.size()));
  hash_in_pieces(hash, bytes_of(tile.masks.data(), tile.masks.size()));
  for (const ChannelInfo& info : kChannels) hash_in_pieces(hash, channel_bytes(tile, info.channel));
  if (tile.full.empty()) return;
  hash.update(bytes_of(&kFullNodesFollow, 1));
  const uint64_t nodes = tile.full.size();
  hash.update(bytes_of(&nodes, 1));
  for (const FullNode& node : tile.full) {
    const uint32_t words[2] = {node.brick_morton, node.level};
    hash.update(bytes_of(words, 2));
  }
}

}  // namespace

ContentHasher::ContentHasher(const Grid& grid) {
  const GridHeader header = container_header(grid);
  hash_.update("voxeld grid 1");
  hash_.update(bytes_of(header.dims.data(), header.dims.size()));
  hash_.update(bytes_of(header.origin.data(), header.origin.size()));
  hash_.update(bytes_of(header.voxel_size.data(), header.voxel_size.size()));
  const uint32_t bits = channel_bits(header.channels), normal = channel_bits({.normal = true});
  const uint8_t channels[2] = {static_cast<uint8_t>(bits & ~normal), header.channels.normal};
  hash_.update(channels);
}

void ContentHasher::add(const SparseTile& tile) {
  if (tile.empty()) return;
  SparseTile copy;
  hash_tile(canonical_form(tile, copy), hash_);
}

std::string content_hash(const Grid& grid) {
  std::vector<const SparseTile*> tiles;
  for (const SparseTile& tile : grid.tiles) tiles.push_back(&tile);
  std::ranges::sort(tiles, {}, [](const SparseTile* tile) { return tile_order(*tile); });
  ContentHasher hasher(grid);
  for (const SparseTile* tile : tiles) {
    cancel_point();
    hasher.add(*tile);
  }
  return hasher.finish();
}

}  // namespace voxeld
