#include "proto/container/grid_excerpt.h"

#include <algorithm>
#include <cstring>

#include "proto/container/grid_directory.h"
#include "proto/container/grid_layout.h"

namespace voxeld {

using namespace grid_layout;

Result<GridExcerpt> excerpt_tiles(std::span<const uint8_t> container, size_t first, size_t count,
                                  const std::string& meta_json) {
  VOXELD_ASSIGN(const GridDirectory directory, GridDirectory::open(container));
  if (first >= directory.tile_count()) {
    return broken_grid(80, "tile count", "above " + std::to_string(first),
                       std::to_string(directory.tile_count()));
  }
  if (meta_json.size() > kMetaBytesMax) {
    return Error{ErrorCode::kInternal, "grid container: meta",
                 "at most " + std::to_string(kMetaBytesMax) + " bytes",
                 std::to_string(meta_json.size())};
  }
  GridExcerpt excerpt;
  excerpt.tile_count = std::min(count, directory.tile_count() - first);
  const size_t entry_bytes = grid_entry_bytes(directory.header().channels);
  const size_t old_entries = kGridHeaderBytes + padded(get<uint32_t>(container, 84));
  const size_t new_entries = kGridHeaderBytes + padded(meta_json.size());
  std::vector<uint8_t>& front = excerpt.front;
  front.resize(new_entries + entry_bytes * excerpt.tile_count);
  std::memcpy(front.data(), container.data(), kGridHeaderBytes);
  std::memcpy(front.data() + kGridHeaderBytes, meta_json.data(), meta_json.size());
  std::memcpy(front.data() + new_entries, container.data() + old_entries + entry_bytes * first,
              entry_bytes * excerpt.tile_count);
  uint64_t voxels = 0;
  for (size_t i = 0; i < excerpt.tile_count; ++i) {
    VOXELD_ASSIGN(const GridTileEntry tile, directory.tile(first + i));
    if (i == 0) excerpt.first_byte = excerpt.end_byte = tile.offset;
    if (tile.offset != excerpt.end_byte) {
      return broken_grid(old_entries + entry_bytes * (first + i) + 24, "tiles have gaps",
                         std::to_string(excerpt.end_byte), std::to_string(tile.offset));
    }
    put(front, new_entries + entry_bytes * i + 24,
        front.size() + (tile.offset - excerpt.first_byte));
    excerpt.end_byte += tile.bytes;
    voxels += tile.voxel_count;
  }
  put(front, 80, static_cast<uint32_t>(excerpt.tile_count));
  put(front, 84, static_cast<uint32_t>(meta_json.size()));
  put(front, 88, voxels);
  put(front, 96, front.size() + (excerpt.end_byte - excerpt.first_byte));
  return excerpt;
}

}  // namespace voxeld
