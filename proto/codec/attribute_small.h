// Codec `small` for attributes: the channels of a tile, predicted from neighbours and entropy coded
// with contexts. proto/README.md specifies the bits.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "proto/result.h"

namespace voxeld {

// The tile must have masks and the channel.
std::vector<uint8_t> encode_channel_small(const SparseTile& tile, Channel channel);

// Fills one channel of a tile that has its masks. Errors: bad-request if the bytes are fewer or
// more than the stream. The time is bounded by the number of voxels in the masks.
Status decode_channel_small(std::span<const uint8_t> bytes, Channel channel, SparseTile& tile);

}  // namespace voxeld
