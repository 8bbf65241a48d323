#include "proto/container/grid_format.h"

#include <algorithm>
#include <cstring>
#include <numeric>

#include "proto/container/grid_layout.h"
#include "proto/container/tile_streams.h"
#include "proto/thread_pool.h"

namespace voxeld {

using namespace grid_layout;

namespace {

// Whether a cube of `bricks`^3 bricks, which begins at `brick_morton`, lies inside dims.
bool fits(const SparseTile& tile, uint32_t brick_morton, int bricks,
          const std::array<int32_t, 3>& dims) {
  const auto at = morton_decode(brick_morton);
  for (size_t c = 0; c < 3; ++c) {
    const int end = static_cast<int>(at[c]) + bricks;
    if (tile.coord[c] * limits::kTileSide + end * limits::kBrickSide > dims[c]) return false;
  }
  return true;
}

bool voxels_fit(const SparseTile& tile, const std::array<int32_t, 3>& dims) {
  bool all = true;
  for (size_t b = 0; b < tile.masks.size(); ++b) {
    if (fits(tile, tile.brick_morton[b], 1, dims)) continue;
    const SparseTile one = {tile.coord, {tile.brick_morton[b]}, {tile.masks[b]}, {}};
    for_each_voxel(one, [&](int x, int y, int z, size_t) {
      all = all && x < dims[0] && y < dims[1] && z < dims[2];
    });
  }
  return all;
}

}  // namespace

Status grid_layout::check_cells(const SparseTile& tile, const std::array<int32_t, 3>& dims) {
  if (fits(tile, 0, limits::kTileSide / limits::kBrickSide, dims)) return {};
  const bool full_fit = std::ranges::all_of(tile.full, [&](const FullNode& node) {
    return fits(tile, node.brick_morton, 1 << node.level, dims);
  });
  if (full_fit && voxels_fit(tile, dims)) return {};
  return broken_grid(0, "a tile has voxels outside dims");
}

Status GridReader::read_header() {
  if (bytes_.size() < kGridHeaderBytes) {
    return broken_grid(bytes_.size(), "the header is cut off",
                       std::to_string(kGridHeaderBytes) + " bytes", std::to_string(bytes_.size()));
  }
  if (std::memcmp(bytes_.data(), kGridMagic, sizeof kGridMagic) != 0) {
    return broken_grid(0, "not a grid container", "the magic VOXGRID", "other bytes");
  }
  const auto version = get<uint32_t>(bytes_, 8), channels = get<uint32_t>(bytes_, 12);
  if (version != kGridVersion) {
    return broken_grid(8, "version", std::to_string(kGridVersion), std::to_string(version));
  }
  if ((channels >> kChannelCount) != 0) return broken_grid(12, "unknown channels");
  header_.channels = channels_of_bits(channels);
  header_.dims = get<std::array<int32_t, 3>>(bytes_, 16);
  header_.origin = get<std::array<double, 3>>(bytes_, 32);
  header_.voxel_size = get<std::array<double, 3>>(bytes_, 56);
  VOXELD_TRY(check_header(header_, 16));
  if (get<uint32_t>(bytes_, 28) != kTileLog2) return broken_grid(28, "tile side", "8", "another");
  tile_count_ = get<uint32_t>(bytes_, 80);
  meta_bytes_ = get<uint32_t>(bytes_, 84);
  voxel_count_ = get<uint64_t>(bytes_, 88);
  const auto total = get<uint64_t>(bytes_, 96);
  if (total != bytes_.size()) {
    return broken_grid(96, "length", std::to_string(total) + " bytes",
                       std::to_string(bytes_.size()));
  }
  VOXELD_TRY(read_codecs());
  for (size_t i = kCodecsByte + kCodecs; i < kGridHeaderBytes; ++i) {
    if (bytes_[i] != 0) return broken_grid(i, "reserved byte", "0", std::to_string(bytes_[i]));
  }
  return {};
}

Status GridReader::read_codecs() {
  for (size_t i = 0; i < kCodecs; ++i) {
    const bool exists = i == 0 || header_.channels.has(kChannels[i - 1].channel);
    const uint8_t codec = bytes_[kCodecsByte + i];
    if (codec > (exists ? 1 : 0)) {
      return broken_grid(kCodecsByte + i, "codec of a stream", exists ? "0 or 1" : "0",
                         std::to_string(codec));
    }
    Codec& place = i == 0 ? header_.codecs.octree : header_.codecs.channels[i - 1];
    place = codec == 1 ? Codec::kSmall : Codec::kFast;
  }
  return {};
}

uint64_t GridReader::Entry::bytes() const {
  return std::accumulate(channel_bytes.begin(), channel_bytes.end(), uint64_t{octree_bytes});
}

// Reads the entry at byte `at`, whose streams must begin at `offset`.
Status GridReader::read_entry(size_t at, uint64_t offset) {
  Entry entry;
  entry.coord = get<std::array<int32_t, 3>>(bytes_, at);
  entry.brick_count = get<uint32_t>(bytes_, at + 12);
  entry.voxel_count = get<uint64_t>(bytes_, at + 16);
  entry.offset = get<uint64_t>(bytes_, at + 24);
  entry.octree_bytes = get<uint32_t>(bytes_, at + 32);
  if (!inside(entry.coord, header_.dims)) return broken_grid(at, "tile coord is outside the grid");
  if (!entries_.empty() && tile_order(entries_.back().coord) >= tile_order(entry.coord)) {
    return broken_grid(at, "tiles are not in ascending Morton order");
  }
  if (entry.voxel_count == 0 || entry.voxel_count > kTileVoxelsMax) {
    return broken_grid(at + 16, "voxel count", "1 to " + std::to_string(kTileVoxelsMax),
                       std::to_string(entry.voxel_count));
  }
  if (entry.offset != offset) {
    return broken_grid(at + 24, "tile offset", std::to_string(offset),
                       std::to_string(entry.offset));
  }
  bool streams_match = entry.octree_bytes != 0;
  size_t next = at + kEntryStreamsByte;
  for (size_t i = 0; i < kChannelCount; ++i) {
    if (!header_.channels.has(kChannels[i].channel)) continue;
    entry.channel_bytes[i] = get<uint32_t>(bytes_, next);
    next += 4;
    streams_match = streams_match && (entry.channel_bytes[i] != 0) == (entry.brick_count != 0);
  }
  if (!streams_match) return broken_grid(at + 32, "streams do not match the channels");
  if (next < at + grid_entry_bytes(header_.channels) && get<uint32_t>(bytes_, next) != 0) {
    return broken_grid(next, "reserved bytes", "0", "others");
  }
  if (offset + entry.bytes() > bytes_.size()) {
    return broken_grid(at + 24, "tile data lie beyond the end");
  }
  entries_.push_back(entry);
  return {};
}

Status GridReader::read_directory(size_t directory) {
  const size_t entry_bytes = grid_entry_bytes(header_.channels);
  uint64_t next = directory + tile_count_ * entry_bytes;
  uint64_t voxels = 0;
  for (size_t i = 0; i < tile_count_; ++i) {
    VOXELD_TRY(read_entry(directory + i * entry_bytes, next));
    next += entries_.back().bytes();
    voxels += entries_.back().voxel_count;
  }
  if (next != bytes_.size()) return broken_grid(next, "bytes after the last tile");
  if (voxels != voxel_count_) {
    return broken_grid(88, "voxel count", std::to_string(voxels), std::to_string(voxel_count_));
  }
  return {};
}

Result<GridReader> GridReader::open(std::span<const uint8_t> bytes) {
  GridReader reader;
  reader.bytes_ = bytes;
  VOXELD_TRY(reader.read_header());
  const size_t directory = kGridHeaderBytes + padded(reader.meta_bytes_);
  if (reader.meta_bytes_ > kMetaBytesMax || directory > bytes.size() ||
      (bytes.size() - directory) / grid_entry_bytes(reader.header_.channels) < reader.tile_count_) {
    return broken_grid(80, "meta or directory is cut off");
  }
  reader.header_.meta_json.assign(reinterpret_cast<const char*>(bytes.data()) + kGridHeaderBytes,
                                  reader.meta_bytes_);
  for (size_t i = kGridHeaderBytes + reader.meta_bytes_; i < directory; ++i) {
    if (bytes[i] != 0) return broken_grid(i, "padding", "0", std::to_string(bytes[i]));
  }
  VOXELD_TRY(reader.read_directory(directory));
  return reader;
}

std::pair<uint64_t, uint64_t> GridReader::tile_byte_range(size_t index) const {
  const Entry& entry = entries_[index];
  return {entry.offset, entry.bytes()};
}

Result<SparseTile> GridReader::decode_tile(size_t index) const {
  const Entry& entry = entries_[index];
  SparseTile tile;
  tile.coord = entry.coord;
  VOXELD_TRY(decode_octree_stream(bytes_.subspan(entry.offset, entry.octree_bytes),
                                  header_.codecs.octree, header_.channels.any(), tile));
  const size_t voxels = tile.voxel_count();
  if (tile.masks.size() != entry.brick_count || voxels != entry.voxel_count) {
    return broken_grid(entry.offset, "octree does not match its directory entry",
                       std::to_string(entry.brick_count) + " bricks and " +
                           std::to_string(entry.voxel_count) + " voxels",
                       std::to_string(tile.masks.size()) + " and " + std::to_string(voxels));
  }
  VOXELD_TRY(check_cells(tile, header_.dims));
  uint64_t at = entry.offset + entry.octree_bytes;
  for (size_t i = 0; i < kChannelCount; ++i) {
    const auto stream = bytes_.subspan(at, entry.channel_bytes[i]);
    at += stream.size();
    if (stream.empty()) continue;
    VOXELD_TRY(
        decode_channel_stream(stream, kChannels[i].channel, header_.codecs.channels[i], tile));
  }
  return tile;
}

Result<std::vector<SparseTile>> GridReader::decode_tiles() const {
  std::vector<SparseTile> tiles(tile_count());
  std::vector<Status> done(tile_count());
  ThreadPool::shared().for_each(tile_count(), [&](size_t i) {
    auto tile = decode_tile(i);
    if (tile) {
      tiles[i] = *std::move(tile);
    } else {
      done[i] = tile.error();
    }
  });
  for (const Status& status : done) VOXELD_TRY(status);
  return tiles;
}

}  // namespace voxeld
