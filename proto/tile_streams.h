// The streams of one tile in the native container: which codec writes and reads which.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/grid_format.h"
#include "proto/stream_codec.h"

namespace voxeld {

// The tile must be canonical and not empty; for a channel, it must have it.
Result<std::vector<uint8_t>> encode_octree_stream(const SparseTile& tile, Codec codec);
Result<std::vector<uint8_t>> encode_channel_stream(const SparseTile& tile, Channel channel,
                                                   Codec codec);

// Each fills its part of the tile, the octree first: the others need its masks. `has_attributes`:
// whether the voxels of masks have any. Errors: bad-request.
Status decode_octree_stream(std::span<const uint8_t> bytes, Codec codec, bool has_attributes,
                            SparseTile& tile);
Status decode_channel_stream(std::span<const uint8_t> bytes, Channel channel, Codec codec,
                             SparseTile& tile);

// How much time the bytes of a channel are worth to codec fast.
StreamKind stream_kind(Channel channel);

// What codec fast compresses of a channel, planes of differences, and back: `raw` must have as many
// bytes as the tile's masks need, else bad-request.
std::vector<uint8_t> raw_channel_stream(const SparseTile& tile, Channel channel);
Status set_raw_channel_stream(std::span<const uint8_t> raw, Channel channel, SparseTile& tile);

}  // namespace voxeld
