// The streams of one tile in the native container, with the codec that writes and reads each.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/codec/stream_codec.h"
#include "proto/container/grid_format.h"

namespace voxeld {

// The tile must be canonical and not empty, and must have the channel.
Result<std::vector<uint8_t>> encode_octree_stream(const SparseTile& tile, Codec codec);
Result<std::vector<uint8_t>> encode_channel_stream(const SparseTile& tile, Channel channel,
                                                   Codec codec);

// Each fills its part of the tile. Decode the octree first: the channels need its masks.
// `has_attributes`: whether the voxels of masks have any. Errors: bad-request.
Status decode_octree_stream(std::span<const uint8_t> bytes, Codec codec, bool has_attributes,
                            SparseTile& tile);
Status decode_channel_stream(std::span<const uint8_t> bytes, Channel channel, Codec codec,
                             SparseTile& tile);

// The kind of a channel's stream, which decides how much time codec fast spends on it.
StreamKind stream_kind(Channel channel);

// The input of codec fast for a channel, planes of differences, and back. `raw` must have as many
// bytes as the tile's masks need, otherwise bad-request.
std::vector<uint8_t> raw_channel_stream(const SparseTile& tile, Channel channel);
Status set_raw_channel_stream(std::span<const uint8_t> raw, Channel channel, SparseTile& tile);

}  // namespace voxeld
