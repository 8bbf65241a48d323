#include "proto/container/grid_writer.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "proto/codec/canonical_tile.h"
#include "proto/container/grid_format.h"
#include "proto/container/grid_layout.h"
#include "proto/container/tile_streams.h"
#include "proto/thread_pool.h"

namespace voxeld {

using namespace grid_layout;

namespace {

bool samples_are_complete(const SparseTile& tile, const ChannelSet& channels) {
  const size_t voxels = tile.attribute_count();
  return std::ranges::all_of(kChannels, [&](const ChannelInfo& info) {
    return channel_bytes(tile, info.channel).size() ==
           (channels.has(info.channel) ? info.bytes() * voxels : 0);
  });
}

bool follows_the_rules(const SparseTile& tile, const GridHeader& header) {
  return tile.brick_morton.size() == tile.masks.size() &&
         samples_are_complete(tile, header.channels) &&
         std::ranges::adjacent_find(tile.brick_morton, std::ranges::greater_equal{}) ==
             tile.brick_morton.end() &&
         (tile.brick_morton.empty() || tile.brick_morton.back() < kTileBricksMax) &&
         std::ranges::find(tile.masks, BrickMask{}) == tile.masks.end() &&
         full_nodes_are_apart(tile) && inside(tile.coord, header.dims) &&
         check_cells(tile, header.dims);
}

void put_header(std::vector<uint8_t>& out, const GridHeader& header, size_t tiles,
                uint64_t voxels) {
  std::memcpy(out.data(), kGridMagic, sizeof kGridMagic);
  put(out, 8, kGridVersion);
  put(out, 12, channel_bits(header.channels));
  put(out, 16, header.dims);
  put(out, 28, kTileLog2);
  put(out, 32, header.origin);
  put(out, 56, header.voxel_size);
  put(out, 80, static_cast<uint32_t>(tiles));
  put(out, 84, static_cast<uint32_t>(header.meta_json.size()));
  put(out, 88, voxels);
  const auto put_codec = [&](size_t i, Codec codec) {
    put(out, kCodecsByte + i, static_cast<uint8_t>(codec == Codec::kSmall ? 1 : 0));
  };
  put_codec(0, header.codecs.octree);
  for (size_t i = 0; i < kChannelCount; ++i) {
    if (header.channels.has(kChannels[i].channel)) put_codec(1 + i, header.codecs.channels[i]);
  }
}

}  // namespace

size_t EncodedTile::bytes() const {
  size_t bytes = octree.size();
  for (const auto& stream : channels) bytes += stream.size();
  return bytes;
}

void EncodedTile::append_to(std::vector<uint8_t>& out) const {
  out.insert(out.end(), octree.begin(), octree.end());
  for (const auto& stream : channels) out.insert(out.end(), stream.begin(), stream.end());
}

Status check_tile(const SparseTile& tile, const GridHeader& header) {
  if (follows_the_rules(tile, header)) return {};
  return Error{ErrorCode::kInternal, "grid container: a tile breaks the rules of SparseTile", "",
               ""};
}

Result<EncodedTile> encode_tile(const SparseTile& tile, const GridHeader& header) {
  VOXELD_TRY(check_tile(tile, header));
  SparseTile copy;
  const SparseTile& canonical = canonical_form(tile, copy);
  EncodedTile out;
  out.coord = tile.coord;
  out.bricks = canonical.masks.size();
  out.voxels = canonical.voxel_count();
  VOXELD_ASSIGN(out.octree, encode_octree_stream(canonical, header.codecs.octree));
  for (size_t i = 0; i < kChannelCount; ++i) {
    const Channel channel = kChannels[i].channel;
    if (channel_bytes(canonical, channel).empty()) continue;
    VOXELD_ASSIGN(out.channels[i],
                  encode_channel_stream(canonical, channel, header.codecs.channels[i]));
  }
  return out;
}

Result<std::vector<EncodedTile>> encode_tiles(std::span<const SparseTile> tiles,
                                              const GridHeader& header) {
  std::vector<EncodedTile> encoded(tiles.size());
  std::vector<Status> done(tiles.size());
  ThreadPool::shared().for_each(tiles.size(), [&](size_t i) {
    if (tiles[i].empty()) return;
    auto one = encode_tile(tiles[i], header);
    if (one) {
      encoded[i] = *std::move(one);
    } else {
      done[i] = one.error();
    }
  });
  for (const Status& status : done) VOXELD_TRY(status);
  std::erase_if(encoded, [](const EncodedTile& tile) { return tile.octree.empty(); });
  return encoded;
}

EncodedTile encoded_tile(std::span<const uint8_t> bytes, const GridReader& reader, size_t index) {
  const ChannelSet& channels = reader.header().channels;
  const size_t directory = kGridHeaderBytes + padded(reader.header().meta_json.size());
  const size_t at = directory + index * grid_entry_bytes(channels);
  uint64_t offset = reader.tile_byte_range(index).first;
  const auto take = [&](uint32_t count) {
    const auto stream = bytes.subspan(offset, count);
    offset += count;
    return std::vector<uint8_t>(stream.begin(), stream.end());
  };
  EncodedTile tile;
  tile.coord = reader.tile_coord(index);
  tile.bricks = get<uint32_t>(bytes, at + 12);
  tile.voxels = reader.tile_voxel_count(index);
  tile.octree = take(get<uint32_t>(bytes, at + 32));
  size_t next = at + kEntryStreamsByte;
  for (size_t i = 0; i < kChannelCount; ++i) {
    if (!channels.has(kChannels[i].channel)) continue;
    tile.channels[i] = take(get<uint32_t>(bytes, next));
    next += sizeof(uint32_t);
  }
  return tile;
}

Result<GridWriter> GridWriter::open(GridHeader header) {
  if (const Status status = check_header(header, 16); !status) {
    return Error{ErrorCode::kInternal, status.error().message(), "", ""};
  }
  return GridWriter(std::move(header));
}

Status GridWriter::add(const EncodedTile& tile) {
  if (!entries_.empty() && tile_order(entries_.back().coord) >= tile_order(tile.coord)) {
    const bool is_twice = entries_.back().coord == tile.coord;
    return Error{ErrorCode::kInternal,
                 is_twice ? "grid container: two tiles have the same coord"
                          : "grid container: tiles are not in ascending Morton order",
                 "", ""};
  }
  Entry& entry = entries_.emplace_back();
  entry.coord = tile.coord;
  entry.voxels = tile.voxels;
  entry.bricks = static_cast<uint32_t>(tile.bricks);
  entry.octree_bytes = static_cast<uint32_t>(tile.octree.size());
  for (size_t i = 0; i < kChannelCount; ++i) {
    entry.channel_bytes[i] = static_cast<uint32_t>(tile.channels[i].size());
  }
  entry.bytes = tile.bytes();
  voxels_ += tile.voxels;
  return {};
}

Result<std::vector<uint8_t>> GridWriter::finish(std::string meta_json) {
  if (meta_json.size() > kMetaBytesMax) {
    return Error{ErrorCode::kInternal, "grid container: meta",
                 "at most " + std::to_string(kMetaBytesMax) + " bytes",
                 std::to_string(meta_json.size())};
  }
  header_.meta_json = std::move(meta_json);
  const size_t directory = kGridHeaderBytes + padded(header_.meta_json.size());
  const size_t entry_bytes = grid_entry_bytes(header_.channels);
  std::vector<uint8_t> out(directory + entry_bytes * entries_.size());
  put_header(out, header_, entries_.size(), voxels_);
  std::memcpy(out.data() + kGridHeaderBytes, header_.meta_json.data(), header_.meta_json.size());
  uint64_t offset = out.size();
  for (size_t i = 0; i < entries_.size(); ++i) {
    const Entry& entry = entries_[i];
    const size_t at = directory + i * entry_bytes;
    put(out, at, entry.coord);
    put(out, at + 12, entry.bricks);
    put(out, at + 16, entry.voxels);
    put(out, at + 24, offset);
    put(out, at + 32, entry.octree_bytes);
    size_t next = at + kEntryStreamsByte;
    for (size_t c = 0; c < kChannelCount; ++c) {
      if (!header_.channels.has(kChannels[c].channel)) continue;
      put(out, next, entry.channel_bytes[c]);
      next += 4;
    }
    offset += entry.bytes;
  }
  put(out, 96, offset);
  return out;
}

Result<std::vector<uint8_t>> encode_grid(const GridHeader& header,
                                         std::span<const SparseTile> tiles) {
  VOXELD_ASSIGN(GridWriter writer, GridWriter::open(header));
  VOXELD_ASSIGN(std::vector<EncodedTile> encoded, encode_tiles(tiles, header));
  std::ranges::sort(encoded, {}, [](const EncodedTile& tile) { return tile_order(tile.coord); });
  size_t bytes = 0;
  for (const EncodedTile& tile : encoded) {
    VOXELD_TRY(writer.add(tile));
    bytes += tile.bytes();
  }
  VOXELD_ASSIGN(std::vector<uint8_t> out, writer.finish(header.meta_json));
  out.reserve(out.size() + bytes);
  for (EncodedTile& tile : encoded) {
    tile.append_to(out);
    tile = {};
  }
  return out;
}

}  // namespace voxeld
