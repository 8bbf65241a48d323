// The attributes of a tile, predicted from neighbours and entropy coded with contexts: the colour
// and normal streams of codec `small`. proto/README.md specifies the bits.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/result.h"
#include "proto/sparse_tile.h"

namespace voxeld {

// The tile must have masks and the attributes.
std::vector<uint8_t> encode_color_small(const SparseTile& tile);
std::vector<uint8_t> encode_normal_small(const SparseTile& tile);

// Fill the attributes of the voxels of `tile.masks`. Errors: bad-request, for streams that are cut
// off or longer than their bits. Take 2 MiB and 1 byte per voxel besides the result, and the time
// of at most 69 bits (colour) or 52 (normal) per voxel, whatever the bytes are.
Status decode_color_small(std::span<const uint8_t> bytes, SparseTile& tile);
Status decode_normal_small(std::span<const uint8_t> bytes, SparseTile& tile);

}  // namespace voxeld
