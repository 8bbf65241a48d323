// The streams of one tile in the native container: which codec writes and reads which.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/grid_format.h"

namespace voxeld {

// The tile must be canonical and not empty; for the attributes, it must have them.
Result<std::vector<uint8_t>> encode_octree_stream(const SparseTile& tile, Codec codec);
Result<std::vector<uint8_t>> encode_color_stream(const SparseTile& tile, Codec codec);
Result<std::vector<uint8_t>> encode_normal_stream(const SparseTile& tile, Codec codec);

// Each fills its part of the tile, the octree first: the others need its masks. `has_attributes`:
// whether the voxels of masks have any. Errors: bad-request.
Status decode_octree_stream(std::span<const uint8_t> bytes, Codec codec, bool has_attributes,
                            SparseTile& tile);
Status decode_color_stream(std::span<const uint8_t> bytes, Codec codec, SparseTile& tile);
Status decode_normal_stream(std::span<const uint8_t> bytes, Codec codec, SparseTile& tile);

}  // namespace voxeld
