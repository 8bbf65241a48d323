#include "proto/container/tile_streams.h"

#include <string>

#include "proto/codec/attribute_small.h"
#include "proto/codec/octree_codec.h"
#include "proto/codec/octree_small.h"
#include "proto/codec/stream_codec.h"

namespace voxeld {

Result<std::vector<uint8_t>> encode_octree_stream(const SparseTile& tile, Codec codec) {
  if (codec == Codec::kSmall) return encode_octree_small(tile);
  return compress_stream(StreamKind::kOctree, octree_from_tile(tile));
}

Result<std::vector<uint8_t>> encode_channel_stream(const SparseTile& tile, Channel channel,
                                                   Codec codec) {
  if (codec == Codec::kSmall) return encode_channel_small(tile, channel);
  return compress_stream(stream_kind(channel), raw_channel_stream(tile, channel));
}

Status decode_octree_stream(std::span<const uint8_t> bytes, Codec codec, bool has_attributes,
                            SparseTile& tile) {
  if (codec == Codec::kSmall) return decode_octree_small(bytes, has_attributes, tile);
  VOXELD_ASSIGN(const auto octree, decompress_stream(bytes, kOctreeBytesMax));
  return tile_from_octree(octree, has_attributes, tile);
}

Status decode_channel_stream(std::span<const uint8_t> bytes, Channel channel, Codec codec,
                             SparseTile& tile) {
  if (codec == Codec::kSmall) return decode_channel_small(bytes, channel, tile);
  const size_t raw_max = channel_info(channel).bytes() * tile.attribute_count();
  VOXELD_ASSIGN(const auto raw, decompress_stream(bytes, raw_max));
  return set_raw_channel_stream(raw, channel, tile);
}

StreamKind stream_kind(Channel channel) {
  return channel_info(channel).is_measure() ? StreamKind::kMeasures : StreamKind::kPlanes;
}

std::vector<uint8_t> raw_channel_stream(const SparseTile& tile, Channel channel) {
  return planes_from_samples(channel_bytes(tile, channel), channel_info(channel).bytes());
}

Status set_raw_channel_stream(std::span<const uint8_t> raw, Channel channel, SparseTile& tile) {
  const size_t planes = channel_info(channel).bytes(), expected = planes * tile.attribute_count();
  if (raw.size() != expected) {
    return Error{ErrorCode::kBadRequest, "grid container, attributes: their bytes",
                 std::to_string(expected), std::to_string(raw.size())};
  }
  set_channel_bytes(tile, channel, samples_from_planes(raw, planes));
  return {};
}

}  // namespace voxeld
