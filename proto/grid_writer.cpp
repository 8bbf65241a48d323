#include <algorithm>
#include <cstring>

#include "proto/canonical_tile.h"
#include "proto/grid_format.h"
#include "proto/grid_layout.h"
#include "proto/tile_streams.h"

namespace voxeld {

using namespace grid_layout;

namespace {

bool follows_the_rules(const SparseTile& tile, const GridHeader& header) {
  const size_t voxels = tile.attribute_count();
  return tile.brick_morton.size() == tile.masks.size() &&
         tile.color.size() == (header.has_color ? kColorChannels * voxels : 0) &&
         tile.normal.size() == (header.has_normal ? kNormalChannels * voxels : 0) &&
         std::ranges::adjacent_find(tile.brick_morton, std::ranges::greater_equal{}) ==
             tile.brick_morton.end() &&
         (tile.brick_morton.empty() || tile.brick_morton.back() < kTileBricksMax) &&
         std::ranges::find(tile.masks, BrickMask{}) == tile.masks.end() &&
         full_nodes_are_apart(tile) && inside(tile.coord, header.dims) &&
         check_cells(tile, header.dims);
}

struct EncodedTile {
  std::array<int32_t, 3> coord{};
  uint64_t bricks = 0, voxels = 0;
  TileStreams streams;
};

Result<EncodedTile> encode_tile(const SparseTile& tile, const GridHeader& header) {
  if (!follows_the_rules(tile, header)) {
    return Error{ErrorCode::kInternal, "grid container: a tile breaks the rules of SparseTile", "",
                 ""};
  }
  SparseTile copy;
  const SparseTile& canonical = canonical_form(tile, copy);
  EncodedTile out;
  out.coord = tile.coord;
  out.bricks = canonical.masks.size();
  out.voxels = canonical.voxel_count();
  VOXELD_ASSIGN(out.streams, encode_streams(canonical, header));
  return out;
}

void put_header(std::vector<uint8_t>& out, const GridHeader& header, size_t tiles,
                uint64_t voxels) {
  std::memcpy(out.data(), kMagic, sizeof kMagic);
  put(out, 8, kGridVersion);
  put(out, 12, (header.has_color ? kColorBit : 0) | (header.has_normal ? kNormalBit : 0));
  put(out, 16, header.dims);
  put(out, 28, kTileLog2);
  put(out, 32, header.origin);
  put(out, 56, header.voxel_size);
  put(out, 80, static_cast<uint32_t>(tiles));
  put(out, 84, static_cast<uint32_t>(header.meta_json.size()));
  put(out, 88, voxels);
  const StreamCodecs& codecs = header.codecs;
  const Codec stored[] = {codecs.octree, header.has_color ? codecs.color : Codec::kFast,
                          header.has_normal ? codecs.normal : Codec::kFast};
  for (size_t i = 0; i < std::size(stored); ++i) {
    put(out, kCodecsByte + i, static_cast<uint8_t>(stored[i] == Codec::kSmall ? 1 : 0));
  }
}

void put_tile(std::vector<uint8_t>& out, size_t entry, const EncodedTile& tile) {
  put(out, entry, tile.coord);
  put(out, entry + 12, static_cast<uint32_t>(tile.bricks));
  put(out, entry + 16, tile.voxels);
  put(out, entry + 24, uint64_t{out.size()});
  put(out, entry + 32, static_cast<uint32_t>(tile.streams.octree.size()));
  put(out, entry + 36, static_cast<uint32_t>(tile.streams.color.size()));
  put(out, entry + 40, static_cast<uint32_t>(tile.streams.normal.size()));
  for (const auto* stream : {&tile.streams.octree, &tile.streams.color, &tile.streams.normal}) {
    out.insert(out.end(), stream->begin(), stream->end());
  }
}

}  // namespace

Result<std::vector<uint8_t>> encode_grid(const GridHeader& header,
                                         std::span<const SparseTile> tiles) {
  if (const Status status = check_header(header, 16); !status) {
    return Error{ErrorCode::kInternal, status.error().message(), "", ""};
  }
  if (header.meta_json.size() > kMetaBytesMax) {
    return Error{ErrorCode::kInternal, "grid container: meta",
                 "at most " + std::to_string(kMetaBytesMax) + " bytes",
                 std::to_string(header.meta_json.size())};
  }
  std::vector<EncodedTile> encoded;
  uint64_t voxels = 0;
  for (const SparseTile& tile : tiles) {
    if (tile.empty()) continue;
    VOXELD_ASSIGN(EncodedTile one, encode_tile(tile, header));
    voxels += one.voxels;
    encoded.push_back(std::move(one));
  }
  std::ranges::sort(encoded, {}, [](const EncodedTile& tile) { return tile_order(tile.coord); });
  if (std::ranges::adjacent_find(encoded, {}, &EncodedTile::coord) != encoded.end()) {
    return Error{ErrorCode::kInternal, "grid container: two tiles have the same coord", "", ""};
  }

  const size_t directory = kGridHeaderBytes + padded(header.meta_json.size());
  std::vector<uint8_t> out(directory + kGridEntryBytes * encoded.size());
  put_header(out, header, encoded.size(), voxels);
  std::memcpy(out.data() + kGridHeaderBytes, header.meta_json.data(), header.meta_json.size());
  for (size_t i = 0; i < encoded.size(); ++i) {
    put_tile(out, directory + i * kGridEntryBytes, encoded[i]);
    encoded[i] = {};
  }
  put(out, 96, uint64_t{out.size()});
  return out;
}

}  // namespace voxeld
