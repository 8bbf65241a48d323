// The streams of one tile in the native container: which codec writes and reads which.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/grid_format.h"

namespace voxeld {

struct TileStreams {
  std::vector<uint8_t> octree, color, normal;
};

// The tile must be canonical, not empty, and hold the header's channels.
Result<TileStreams> encode_streams(const SparseTile& tile, const GridHeader& header);

// Each fills its part of the tile, the octree first: the others need its masks. Errors: bad-request.
Status decode_octree_stream(std::span<const uint8_t> bytes, const GridHeader& header,
                            SparseTile& tile);
Status decode_color_stream(std::span<const uint8_t> bytes, Codec codec, SparseTile& tile);
Status decode_normal_stream(std::span<const uint8_t> bytes, Codec codec, SparseTile& tile);

}  // namespace voxeld
