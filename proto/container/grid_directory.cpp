#include "proto/container/grid_directory.h"

#include <cstring>

#include "proto/container/grid_layout.h"

namespace voxeld {

using namespace grid_layout;

Result<GridDirectory> GridDirectory::open(std::span<const uint8_t> bytes) {
  if (bytes.size() < kGridHeaderBytes ||
      std::memcmp(bytes.data(), kGridMagic, sizeof kGridMagic) != 0) {
    return broken_grid(0, "not a grid container", "the magic VOXGRID", "other bytes");
  }
  const auto version = get<uint32_t>(bytes, 8), channels = get<uint32_t>(bytes, 12);
  if (version != kGridVersion) {
    return broken_grid(8, "version", std::to_string(kGridVersion), std::to_string(version));
  }
  if ((channels >> kChannelCount) != 0) return broken_grid(12, "unknown channels");
  GridDirectory directory;
  directory.bytes_ = bytes;
  directory.header_.channels = channels_of_bits(channels);
  directory.header_.dims = get<std::array<int32_t, 3>>(bytes, 16);
  directory.header_.origin = get<std::array<double, 3>>(bytes, 32);
  directory.header_.voxel_size = get<std::array<double, 3>>(bytes, 56);
  VOXELD_TRY(check_header(directory.header_, 16));
  directory.tile_count_ = get<uint32_t>(bytes, 80);
  directory.voxel_count_ = get<uint64_t>(bytes, 88);
  const size_t meta_bytes = get<uint32_t>(bytes, 84);
  directory.first_entry_ = kGridHeaderBytes + padded(meta_bytes);
  if (meta_bytes > kMetaBytesMax || directory.first_entry_ > bytes.size() ||
      (bytes.size() - directory.first_entry_) / grid_entry_bytes(directory.header_.channels) <
          directory.tile_count_) {
    return broken_grid(80, "meta or directory is cut off");
  }
  return directory;
}

Result<GridTileEntry> GridDirectory::tile(size_t index) const {
  const size_t at = first_entry_ + index * grid_entry_bytes(header_.channels);
  GridTileEntry entry;
  entry.coord = get<std::array<int32_t, 3>>(bytes_, at);
  entry.voxel_count = get<uint64_t>(bytes_, at + 16);
  entry.offset = get<uint64_t>(bytes_, at + 24);
  entry.bytes = get<uint32_t>(bytes_, at + 32);
  for (size_t i = 0; i < header_.channels.count(); ++i) {
    entry.bytes += get<uint32_t>(bytes_, at + kEntryStreamsByte + 4 * i);
  }
  if (!inside(entry.coord, header_.dims)) return broken_grid(at, "tile coord is outside the grid");
  if (entry.offset > bytes_.size() || entry.bytes > bytes_.size() - entry.offset) {
    return broken_grid(at + 24, "tile data lie beyond the end");
  }
  return entry;
}

}  // namespace voxeld
