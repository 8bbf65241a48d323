// The streams of a native container's tiles as they are stored, for callers that copy them without
// decoding.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "proto/container/grid_format.h"

namespace voxeld {

// One tile as the directory describes it.
struct StoredTile {
  std::array<int32_t, 3> coord{};  // in tiles
  uint32_t brick_count = 0;        // outside full nodes
  uint64_t voxel_count = 0;        // those in full nodes included
  // By kind: 0 the octree, 1 + the number of a channel. Empty if the tile has no such stream.
  std::array<std::span<const uint8_t>, 1 + kChannelCount> streams{};
};

// Tile `index` of `container`, the bytes that `reader` has opened. The contents of the streams are
// not checked.
StoredTile stored_tile(std::span<const uint8_t> container, const GridReader& reader, size_t index);

}  // namespace voxeld
