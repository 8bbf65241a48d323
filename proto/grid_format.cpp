#include "proto/grid_format.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "proto/octree_codec.h"
#include "proto/stream_codec.h"

namespace voxeld {
namespace {

static_assert(std::endian::native == std::endian::little, "the container is little-endian");

constexpr char kMagic[8] = {'V', 'O', 'X', 'G', 'R', 'I', 'D', '\0'};
constexpr uint32_t kTileLog2 = 8;
constexpr uint32_t kColorBit = 1, kNormalBit = 2;
constexpr size_t kColorChannels = 4, kNormalChannels = 3;
constexpr uint32_t kTileBricksMax = 1u << 3 * (kTileLog2 - 3);
constexpr uint64_t kTileVoxelsMax = uint64_t{1} << (3 * kTileLog2);
constexpr size_t kMetaBytesMax = size_t{1} << 24;

template <typename T>
void put(std::vector<uint8_t>& out, size_t at, T value) {
  std::memcpy(out.data() + at, &value, sizeof value);
}

template <typename T>
T get(std::span<const uint8_t> bytes, size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

size_t padded(size_t bytes) {
  return (bytes + 7) & ~size_t{7};
}

Error broken(uint64_t byte, std::string detail, std::string expected = "", std::string got = "") {
  return {ErrorCode::kBadRequest,
          "grid container, byte " + std::to_string(byte) + ": " + std::move(detail),
          std::move(expected), std::move(got)};
}

uint32_t tile_order(const std::array<int32_t, 3>& coord) {
  return morton_encode(static_cast<uint32_t>(coord[0]), static_cast<uint32_t>(coord[1]),
                       static_cast<uint32_t>(coord[2]));
}

bool inside(const std::array<int32_t, 3>& coord, const std::array<int32_t, 3>& dims) {
  for (size_t c = 0; c < 3; ++c) {
    const int tiles = (dims[c] + limits::kTileSide - 1) / limits::kTileSide;
    if (coord[c] < 0 || coord[c] >= tiles) return false;
  }
  return true;
}

Status check_header(const GridHeader& header, uint64_t byte) {
  for (size_t c = 0; c < 3; ++c) {
    if (header.dims[c] < 1 || header.dims[c] > limits::kGridSideMax) {
      return broken(byte, "dims", "1 to " + std::to_string(limits::kGridSideMax),
                    std::to_string(header.dims[c]));
    }
    if (!std::isfinite(header.origin[c])) return broken(byte, "origin is not finite");
    if (!std::isfinite(header.voxel_size[c]) || header.voxel_size[c] <= 0) {
      return broken(byte, "voxel size", "a finite number above 0",
                    std::to_string(header.voxel_size[c]));
    }
  }
  return {};
}

// All voxels of the tile lie inside dims.
Status check_cells(const SparseTile& tile, const std::array<int32_t, 3>& dims) {
  bool fits = true;
  for (size_t c = 0; c < 3; ++c) {
    fits = fits && (tile.coord[c] + 1) * limits::kTileSide <= dims[c];
  }
  if (fits) return {};
  bool outside = false;
  for_each_voxel(tile, [&](int x, int y, int z, size_t) {
    outside = outside || x >= dims[0] || y >= dims[1] || z >= dims[2];
  });
  if (outside) return broken(0, "a tile has voxels outside dims");
  return {};
}

bool follows_the_rules(const SparseTile& tile, const GridHeader& header) {
  const size_t voxels = tile.voxel_count();
  return tile.brick_morton.size() == tile.masks.size() &&
         tile.color.size() == (header.has_color ? kColorChannels * voxels : 0) &&
         tile.normal.size() == (header.has_normal ? kNormalChannels * voxels : 0) &&
         std::ranges::adjacent_find(tile.brick_morton, std::ranges::greater_equal{}) ==
             tile.brick_morton.end() &&
         tile.brick_morton.back() < kTileBricksMax &&
         std::ranges::find(tile.masks, BrickMask{}) == tile.masks.end() &&
         inside(tile.coord, header.dims) && check_cells(tile, header.dims);
}

struct EncodedTile {
  std::array<int32_t, 3> coord{};
  uint64_t bricks = 0, voxels = 0;
  std::vector<uint8_t> octree, color, normal;
};

Result<EncodedTile> encode_tile(const SparseTile& tile, const GridHeader& header) {
  EncodedTile out;
  out.coord = tile.coord;
  out.bricks = tile.masks.size();
  out.voxels = tile.voxel_count();
  if (!follows_the_rules(tile, header)) {
    return Error{ErrorCode::kInternal, "grid container: a tile breaks the rules of SparseTile", "",
                 ""};
  }
  VOXELD_ASSIGN(out.octree, compress_stream(octree_from_bricks(tile)));
  if (header.has_color) {
    VOXELD_ASSIGN(out.color, compress_stream(planes_from_samples(tile.color, kColorChannels)));
  }
  if (header.has_normal) {
    const std::span<const uint8_t> samples(reinterpret_cast<const uint8_t*>(tile.normal.data()),
                                           tile.normal.size());
    VOXELD_ASSIGN(out.normal, compress_stream(planes_from_samples(samples, kNormalChannels)));
  }
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
}

void put_tile(std::vector<uint8_t>& out, size_t entry, const EncodedTile& tile) {
  put(out, entry, tile.coord);
  put(out, entry + 12, static_cast<uint32_t>(tile.bricks));
  put(out, entry + 16, tile.voxels);
  put(out, entry + 24, uint64_t{out.size()});
  put(out, entry + 32, static_cast<uint32_t>(tile.octree.size()));
  put(out, entry + 36, static_cast<uint32_t>(tile.color.size()));
  put(out, entry + 40, static_cast<uint32_t>(tile.normal.size()));
  for (const auto* stream : {&tile.octree, &tile.color, &tile.normal}) {
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
    if (tile.masks.empty()) continue;
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
  for (size_t i = 104; i < kGridHeaderBytes; ++i) {
    if (bytes_[i] != 0) return broken(i, "reserved byte", "0", std::to_string(bytes_[i]));
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
    if ((entry.color_bytes != 0) != header_.has_color ||
        (entry.normal_bytes != 0) != header_.has_normal || entry.octree_bytes == 0) {
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
  const auto octree = bytes_.subspan(entry.offset, entry.octree_bytes);
  VOXELD_ASSIGN(const auto masks, decompress_stream(octree, kOctreeBytesMax));
  VOXELD_TRY(bricks_from_octree(masks, tile));
  const size_t voxels = tile.voxel_count();
  if (tile.masks.size() != entry.brick_count || voxels != entry.voxel_count) {
    return broken(entry.offset, "octree does not match its directory entry",
                  std::to_string(entry.brick_count) + " bricks and " +
                      std::to_string(entry.voxel_count) + " voxels",
                  std::to_string(tile.masks.size()) + " and " + std::to_string(voxels));
  }
  VOXELD_TRY(check_cells(tile, header_.dims));
  uint64_t at = entry.offset + entry.octree_bytes;
  const auto attribute = [&](uint32_t stored, size_t channels) -> Result<std::vector<uint8_t>> {
    VOXELD_ASSIGN(const auto planes,
                  decompress_stream(bytes_.subspan(at, stored), channels * voxels));
    if (planes.size() != channels * voxels) {
      return broken(at, "attribute bytes", std::to_string(channels * voxels),
                    std::to_string(planes.size()));
    }
    at += stored;
    return samples_from_planes(planes, channels);
  };
  if (header_.has_color) {
    VOXELD_ASSIGN(tile.color, attribute(entry.color_bytes, kColorChannels));
  }
  if (header_.has_normal) {
    VOXELD_ASSIGN(const auto samples, attribute(entry.normal_bytes, kNormalChannels));
    tile.normal.resize(samples.size());
    std::memcpy(tile.normal.data(), samples.data(), samples.size());
  }
  return tile;
}

}  // namespace voxeld
