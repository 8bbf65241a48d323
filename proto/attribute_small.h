// The attributes of a tile, predicted from neighbours and entropy coded with contexts: streams of
// channels in codec `small`. proto/README.md specifies the bits.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/result.h"
#include "proto/sparse_tile.h"

namespace voxeld {

// The tile must have masks and the channel.
std::vector<uint8_t> encode_channel_small(const SparseTile& tile, Channel channel);

// Fills the channel of a tile with masks. Errors: bad-request, when the bytes are fewer or more
// than the stream. Takes time for at most as many voxels as the masks have.
Status decode_channel_small(std::span<const uint8_t> bytes, Channel channel, SparseTile& tile);

}  // namespace voxeld
