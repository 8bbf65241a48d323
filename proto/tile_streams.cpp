#include "proto/tile_streams.h"

#include <algorithm>
#include <cstring>
#include <string>

#include "proto/attribute_small.h"
#include "proto/octree_codec.h"
#include "proto/octree_small.h"
#include "proto/stream_codec.h"

namespace voxeld {
namespace {

constexpr size_t kColorChannels = 4, kNormalChannels = 3;

std::span<const uint8_t> normal_bytes(const SparseTile& tile) {
  return {reinterpret_cast<const uint8_t*>(tile.normal.data()), tile.normal.size()};
}

Result<std::vector<uint8_t>> decode_planes(std::span<const uint8_t> bytes, size_t voxels,
                                           size_t channels) {
  VOXELD_ASSIGN(const auto planes, decompress_stream(bytes, channels * voxels));
  if (planes.size() != channels * voxels) {
    return Error{ErrorCode::kBadRequest, "grid container, attributes: their bytes",
                 std::to_string(channels * voxels), std::to_string(planes.size())};
  }
  return samples_from_planes(planes, channels);
}

}  // namespace

Result<std::vector<uint8_t>> encode_octree_stream(const SparseTile& tile, Codec codec) {
  if (codec == Codec::kSmall) return encode_octree_small(tile);
  return compress_stream(octree_from_tile(tile));
}

Result<std::vector<uint8_t>> encode_color_stream(const SparseTile& tile, Codec codec) {
  if (codec == Codec::kSmall) return encode_color_small(tile);
  return compress_stream(planes_from_samples(tile.color, kColorChannels));
}

Result<std::vector<uint8_t>> encode_normal_stream(const SparseTile& tile, Codec codec) {
  if (codec == Codec::kSmall) return encode_normal_small(tile);
  return compress_stream(planes_from_samples(normal_bytes(tile), kNormalChannels));
}

Status decode_octree_stream(std::span<const uint8_t> bytes, Codec codec, bool has_attributes,
                            SparseTile& tile) {
  if (codec == Codec::kSmall) return decode_octree_small(bytes, has_attributes, tile);
  VOXELD_ASSIGN(const auto octree, decompress_stream(bytes, kOctreeBytesMax));
  return tile_from_octree(octree, has_attributes, tile);
}

Status decode_color_stream(std::span<const uint8_t> bytes, Codec codec, SparseTile& tile) {
  if (codec == Codec::kSmall) return decode_color_small(bytes, tile);
  VOXELD_ASSIGN(tile.color, decode_planes(bytes, tile.attribute_count(), kColorChannels));
  return {};
}

Status decode_normal_stream(std::span<const uint8_t> bytes, Codec codec, SparseTile& tile) {
  if (codec == Codec::kSmall) return decode_normal_small(bytes, tile);
  VOXELD_ASSIGN(const auto samples, decode_planes(bytes, tile.attribute_count(), kNormalChannels));
  tile.normal.resize(samples.size());
  if (!samples.empty()) std::memcpy(tile.normal.data(), samples.data(), samples.size());
  return {};
}

}  // namespace voxeld
