#include "proto/container/grid_streams.h"

#include <algorithm>

#include "proto/container/grid_layout.h"

namespace voxeld {

using namespace grid_layout;

StoredTile stored_tile(std::span<const uint8_t> container, const GridReader& reader, size_t index) {
  const GridHeader& header = reader.header();
  const size_t directory = kGridHeaderBytes + padded(header.meta_json.size());
  const size_t entry = directory + index * grid_entry_bytes(header.channels);
  const auto [offset, bytes] = reader.tile_byte_range(index);
  std::span<const uint8_t> rest = container.subspan(offset, bytes);
  StoredTile tile;
  tile.coord = reader.tile_coord(index);
  tile.brick_count = get<uint32_t>(container, entry + 12);
  tile.voxel_count = reader.tile_voxel_count(index);
  size_t next = entry + kEntryStreamsByte - 4;  // the octree's bytes, then those of channels
  for (size_t kind = 0; kind < tile.streams.size(); ++kind) {
    if (kind > 0 && !header.channels.has(kChannels[kind - 1].channel)) continue;
    // Clamped although the reader has checked the lengths: a mapped file may still change.
    const size_t length = std::min<size_t>(get<uint32_t>(container, next), rest.size());
    tile.streams[kind] = rest.first(length);
    rest = rest.subspan(length);
    next += 4;
  }
  return tile;
}

}  // namespace voxeld
