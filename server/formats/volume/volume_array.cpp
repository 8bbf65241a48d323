#include "server/formats/volume/volume_array.h"

#include <cstring>

#include "server/base/check.h"
#include "server/formats/npy/npy_array.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld::volume {
namespace {

OutputOptions with_axes(OutputOptions options, Components components) {
  options.axes = components == Components::kPlanar ? AxisOrder::kXyz : AxisOrder::kZyx;
  return options;
}

SampleType sample_type(std::string_view descr) {
  if (descr == "<f4") return SampleType::kFloat32;
  if (descr == "<u2") return SampleType::kUint16;
  if (descr == "|i1") return SampleType::kInt8;
  VOXELD_CHECK(descr == "|u1" || descr == "|b1", "a sample type that volumes do not have");
  return SampleType::kUint8;
}

bool is_distance(std::optional<Channel> channel) {
  return channel && channel_info(*channel).kind == ChannelKind::kDistance;
}

}  // namespace

ArrayType array_type(std::optional<Channel> channel, const OutputOptions& options) {
  const NpyType type = npy_type(channel, options);
  return {sample_type(type.descr), type.sample_bytes, type.components};
}

VolumeArray::VolumeArray(const Grid& grid, std::optional<Channel> channel,
                         const OutputOptions& options, Components components)
    : array_(grid, channel, with_axes(options, components)),
      scale_(is_distance(channel) ? distance_scale(grid) : 1.0) {}

void VolumeArray::fill(size_t piece, std::span<uint8_t> bytes) const {
  array_.fill(piece, bytes);
  if (scale_ == 1.0) return;
  for (size_t at = 0; at < bytes.size(); at += sizeof(float)) {
    float distance = 0;
    std::memcpy(&distance, &bytes[at], sizeof distance);
    distance = static_cast<float>(distance * scale_);
    std::memcpy(&bytes[at], &distance, sizeof distance);
  }
}

std::string_view array_name(std::optional<Channel> channel) {
  return channel ? channel_info(*channel).name : "occupancy";
}

Status append_pieces(DeflateStream& stream, const ArrayPieces& array) {
  return stream.add_pieces(
      array.piece_count(), [&](size_t i) { return array.piece_bytes(i); },
      [&](size_t i, std::span<uint8_t> bytes) { array.fill(i, bytes); }, array.repeats());
}

}  // namespace voxeld::volume
