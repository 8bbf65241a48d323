// The streams of codec small. The first byte says what the rest is: the octree of a tile without or
// with attributes; a channel of a small tile; or cells that must come back.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/codec/attribute_small.h"
#include "proto/codec/canonical_tile.h"
#include "proto/codec/octree_small.h"
#include "server/base/check.h"
#include "tests/unit/proto/tile_maker.h"

namespace {

using Bytes = std::span<const uint8_t>;

constexpr voxeld::ChannelSet kAll = voxeld::channels_of_bits(voxeld::test::kChannelSets - 1);

void octree(Bytes bytes, bool has_attributes) {
  voxeld::SparseTile tile;
  if (const auto status = voxeld::decode_octree_small(bytes, has_attributes, tile); !status) {
    VOXELD_CHECK(status.error().code == voxeld::ErrorCode::kBadRequest, "input is a bad request");
    return;
  }
  VOXELD_CHECK(!tile.empty() && voxeld::full_nodes_are_apart(tile) &&
                   voxeld::is_canonical(tile, has_attributes) &&
                   std::ranges::find(tile.masks, voxeld::BrickMask{}) == tile.masks.end(),
               "a tile is canonical");
  voxeld::SparseTile back;
  const auto written = voxeld::encode_octree_small(tile);
  VOXELD_CHECK(voxeld::decode_octree_small(written, has_attributes, back).ok() && back == tile,
               "what is read can be written");
}

// A ball of bricks' corners: neighbours of all kinds, few enough to be quick.
voxeld::SparseTile small_tile() {
  voxeld::SparseTile tile;
  for (const uint32_t brick : {0u, 1u, 2u, 7u, 100u, 32767u}) {
    tile.brick_morton.push_back(brick);
    tile.masks.emplace_back().words = {~uint64_t{0}, 1, 0x8000000000000001u, 0xff, 0, 0xf0f0, 3, 5};
  }
  return tile;
}

void attributes(Bytes bytes) {
  for (const voxeld::ChannelInfo& info : voxeld::kChannels) {
    voxeld::SparseTile tile = small_tile(), back = small_tile();
    if (!voxeld::decode_channel_small(bytes, info.channel, tile)) continue;
    VOXELD_CHECK(
        voxeld::channel_bytes(tile, info.channel).size() == info.bytes() * tile.attribute_count(),
        "samples for each voxel");
    const auto written = voxeld::encode_channel_small(tile, info.channel);
    VOXELD_CHECK(voxeld::decode_channel_small(written, info.channel, back).ok() && back == tile,
                 "samples come back");
  }
}

// Four bytes a voxel: x, y, z and what its attributes are made from; then bricks that become full.
void cells(Bytes bytes) {
  std::vector<voxeld::test::TestVoxel> voxels;
  std::vector<uint32_t> full;
  for (; bytes.size() >= 4; bytes = bytes.subspan(4)) {
    if (bytes[3] >= 250) {
      full.push_back((bytes[0] | uint32_t{bytes[1]} << 8) & 0x7fff);
      continue;
    }
    auto& voxel = voxels.emplace_back();
    voxel.cell = {bytes[0], bytes[1], bytes[2]};
    voxel.color = {bytes[3], bytes[0], 7, 255};
    voxel.normal = {static_cast<int8_t>(bytes[3]), static_cast<int8_t>(bytes[1]), -128};
    voxel.material = static_cast<uint16_t>(bytes[3] << 8 | bytes[2]);
    voxel.label = bytes[3] % 3;
    voxel.distance = static_cast<int16_t>((bytes[3] - 128) * bytes[0]);
    voxel.coverage = bytes[3];
  }
  if (voxels.empty()) return;
  voxeld::SparseTile tile = voxeld::test::tiles_of(voxels, kAll)[0];
  std::ranges::sort(full);
  full.erase(std::unique(full.begin(), full.end()), full.end());
  for (const uint32_t brick : full) {
    if (!std::ranges::binary_search(tile.brick_morton, brick)) tile.full.push_back({brick, 0});
  }
  voxeld::canonicalize(tile);
  voxeld::SparseTile back;
  bool read = voxeld::decode_octree_small(voxeld::encode_octree_small(tile), true, back).ok();
  for (const voxeld::ChannelInfo& info : voxeld::kChannels) {
    const auto written = voxeld::encode_channel_small(tile, info.channel);
    read = read && voxeld::decode_channel_small(written, info.channel, back).ok();
  }
  VOXELD_CHECK(read && back == tile, "a tile comes back");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const Bytes rest(data + 1, size - 1);
  switch (data[0] % 4) {
    case 0:
    case 1:
      octree(rest, data[0] % 4 == 1);
      break;
    case 2:
      attributes(rest);
      break;
    default:
      cells(rest);
  }
  return 0;
}
