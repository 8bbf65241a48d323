#include "proto/grid_format.h"

#include <algorithm>
#include <cstring>

#include "proto/grid_layout.h"
#include "proto/parallel.h"
#include "proto/tile_streams.h"

namespace voxeld {

using namespace grid_layout;

namespace {

// A cube of bricks of a tile, by its first one and its side.
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
    const SparseTile one = {tile.coord, {tile.brick_morton[b]}, {tile.masks[b]}, {}, {}, {}};
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
  return broken(0, "a tile has voxels outside dims");
}

Status GridReader::read_header() {
  if (bytes_.size() < kGridHeaderBytes) {
    return broken(bytes_.size(), "the header is cut off",
                  std::to_string(kGridHeaderBytes) + " bytes", std::to_string(bytes_.size()));
  }
  if (std::memcmp(bytes_.data(), kMagic, sizeof kMagic) != 0) {
    return broken(0, "not a grid container", "the magic VOXGRID", "other bytes");
  }
  const auto version = get<uint32_t>(bytes_, 8), channels = get<uint32_t>(bytes_, 12);
  if (version != kGridVersion) {
    return broken(8, "version", std::to_string(kGridVersion), std::to_string(version));
  }
  if ((channels & ~(kColorBit | kNormalBit)) != 0) return broken(12, "unknown channels");
  header_.has_color = (channels & kColorBit) != 0;
  header_.has_normal = (channels & kNormalBit) != 0;
  header_.dims = get<std::array<int32_t, 3>>(bytes_, 16);
  header_.origin = get<std::array<double, 3>>(bytes_, 32);
  header_.voxel_size = get<std::array<double, 3>>(bytes_, 56);
  VOXELD_TRY(check_header(header_, 16));
  if (get<uint32_t>(bytes_, 28) != kTileLog2) return broken(28, "tile side", "8", "another");
  tile_count_ = get<uint32_t>(bytes_, 80);
  meta_bytes_ = get<uint32_t>(bytes_, 84);
  voxel_count_ = get<uint64_t>(bytes_, 88);
  const auto total = get<uint64_t>(bytes_, 96);
  if (total != bytes_.size()) {
    return broken(96, "length", std::to_string(total) + " bytes", std::to_string(bytes_.size()));
  }
  VOXELD_TRY(read_codecs());
  for (size_t i = kCodecsByte + 3; i < kGridHeaderBytes; ++i) {
    if (bytes_[i] != 0) return broken(i, "reserved byte", "0", std::to_string(bytes_[i]));
  }
  return {};
}

Status GridReader::read_codecs() {
  StreamCodecs& codecs = header_.codecs;
  Codec* const places[] = {&codecs.octree, &codecs.color, &codecs.normal};
  const bool exists[] = {true, header_.has_color, header_.has_normal};
  for (size_t i = 0; i < std::size(places); ++i) {
    const uint8_t codec = bytes_[kCodecsByte + i];
    if (codec > (exists[i] ? 1 : 0)) {
      return broken(kCodecsByte + i, "codec of a stream", exists[i] ? "0 or 1" : "0",
                    std::to_string(codec));
    }
    *places[i] = codec == 1 ? Codec::kSmall : Codec::kFast;
  }
  return {};
}

Status GridReader::read_directory(size_t directory) {
  uint64_t next = directory + tile_count_ * kGridEntryBytes;
  uint64_t voxels = 0;
  for (size_t i = 0; i < tile_count_; ++i) {
    const size_t at = directory + i * kGridEntryBytes;
    Entry entry;
    entry.coord = get<std::array<int32_t, 3>>(bytes_, at);
    entry.brick_count = get<uint32_t>(bytes_, at + 12);
    entry.voxel_count = get<uint64_t>(bytes_, at + 16);
    entry.offset = get<uint64_t>(bytes_, at + 24);
    entry.octree_bytes = get<uint32_t>(bytes_, at + 32);
    entry.color_bytes = get<uint32_t>(bytes_, at + 36);
    entry.normal_bytes = get<uint32_t>(bytes_, at + 40);
    if (!inside(entry.coord, header_.dims)) return broken(at, "tile coord is outside the grid");
    if (!entries_.empty() && tile_order(entries_.back().coord) >= tile_order(entry.coord)) {
      return broken(at, "tiles are not in ascending Morton order");
    }
    if (entry.voxel_count == 0 || entry.voxel_count > kTileVoxelsMax) {
      return broken(at + 16, "voxel count", "1 to " + std::to_string(kTileVoxelsMax),
                    std::to_string(entry.voxel_count));
    }
    if (entry.offset != next) {
      return broken(at + 24, "tile offset", std::to_string(next), std::to_string(entry.offset));
    }
    if (get<uint32_t>(bytes_, at + 44) != 0)
      return broken(at + 44, "reserved bytes", "0", "others");
    const bool has_bricks = entry.brick_count != 0;
    if ((entry.color_bytes != 0) != (header_.has_color && has_bricks) ||
        (entry.normal_bytes != 0) != (header_.has_normal && has_bricks) ||
        entry.octree_bytes == 0) {
      return broken(at + 32, "streams do not match the channels");
    }
    next += uint64_t{entry.octree_bytes} + entry.color_bytes + entry.normal_bytes;
    if (next > bytes_.size()) return broken(at + 24, "tile data lie beyond the end");
    voxels += entry.voxel_count;
    entries_.push_back(entry);
  }
  if (next != bytes_.size()) return broken(next, "bytes after the last tile");
  if (voxels != voxel_count_) {
    return broken(88, "voxel count", std::to_string(voxels), std::to_string(voxel_count_));
  }
  return {};
}

Result<GridReader> GridReader::open(std::span<const uint8_t> bytes) {
  GridReader reader;
  reader.bytes_ = bytes;
  VOXELD_TRY(reader.read_header());
  const size_t directory = kGridHeaderBytes + padded(reader.meta_bytes_);
  if (reader.meta_bytes_ > kMetaBytesMax || directory > bytes.size() ||
      (bytes.size() - directory) / kGridEntryBytes < reader.tile_count_) {
    return broken(80, "meta or directory is cut off");
  }
  reader.header_.meta_json.assign(reinterpret_cast<const char*>(bytes.data()) + kGridHeaderBytes,
                                  reader.meta_bytes_);
  for (size_t i = kGridHeaderBytes + reader.meta_bytes_; i < directory; ++i) {
    if (bytes[i] != 0) return broken(i, "padding", "0", std::to_string(bytes[i]));
  }
  VOXELD_TRY(reader.read_directory(directory));
  return reader;
}

std::pair<uint64_t, uint64_t> GridReader::tile_byte_range(size_t index) const {
  const Entry& entry = entries_[index];
  return {entry.offset, uint64_t{entry.octree_bytes} + entry.color_bytes + entry.normal_bytes};
}

Result<SparseTile> GridReader::decode_tile(size_t index) const {
  const Entry& entry = entries_[index];
  SparseTile tile;
  tile.coord = entry.coord;
  VOXELD_TRY(decode_octree_stream(bytes_.subspan(entry.offset, entry.octree_bytes),
                                  header_.codecs.octree, header_.has_color || header_.has_normal,
                                  tile));
  const size_t voxels = tile.voxel_count();
  if (tile.masks.size() != entry.brick_count || voxels != entry.voxel_count) {
    return broken(entry.offset, "octree does not match its directory entry",
                  std::to_string(entry.brick_count) + " bricks and " +
                      std::to_string(entry.voxel_count) + " voxels",
                  std::to_string(tile.masks.size()) + " and " + std::to_string(voxels));
  }
  VOXELD_TRY(check_cells(tile, header_.dims));
  const auto color = bytes_.subspan(entry.offset + entry.octree_bytes, entry.color_bytes);
  const auto normal =
      bytes_.subspan(entry.offset + entry.octree_bytes + entry.color_bytes, entry.normal_bytes);
  if (!color.empty()) VOXELD_TRY(decode_color_stream(color, header_.codecs.color, tile));
  if (!normal.empty()) VOXELD_TRY(decode_normal_stream(normal, header_.codecs.normal, tile));
  return tile;
}

Result<std::vector<SparseTile>> GridReader::decode_tiles() const {
  std::vector<SparseTile> tiles(tile_count());
  std::vector<Status> done(tile_count());
  for_each_parallel(tile_count(), [&](size_t i) {
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
