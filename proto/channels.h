// The attribute channels that a grid's voxels can have. One table drives the container, the
// content hash, the exports and the decoders. A new channel of a known kind is an entry here, its
// members of ChannelSet and SparseTile, and the code that computes it.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace voxeld {

// The channels in the order in which they are stored; a channel's number is its bit in the
// container.
enum class Channel : uint8_t { kColor, kNormal, kMaterial, kLabel, kDistance, kCoverage };
inline constexpr size_t kChannelCount = 6;

// Steps of the distance channel per voxel; with distance=world, per shortest edge of a voxel.
inline constexpr int kDistanceSteps = 128;

// The channels of one grid.
struct ChannelSet {
  bool color = false;     // sRGB R, G, B and linear A
  bool normal = false;    // unit normal times 127
  bool material = false;  // ids from 1 on; 0: none
  bool label = false;     // likewise
  bool distance = false;  // signed: 1/128 voxel, or 1/128 of its shortest edge
  bool coverage = false;  // 255: the whole voxel is covered

  constexpr bool has(Channel channel) const;
  constexpr void set(Channel channel, bool on = true);
  constexpr bool any() const;
  constexpr size_t count() const;
  bool operator==(const ChannelSet&) const = default;
};

// What the samples of a channel mean. Predictors, dense arrays and fills depend on the kind alone.
enum class ChannelKind : uint8_t {
  kColor,     // R, G, B in sRGB, then linear alpha
  kVector,    // components of a unit vector times the largest sample
  kId,        // ids from 1 on; 0: none
  kDistance,  // signed, in 1/kDistanceSteps of distance_unit()
  kFraction,  // the largest sample is 1
};

struct ChannelInfo {
  Channel channel;
  std::string_view name;  // as in the option, the npz member and the JSON
  ChannelKind kind;
  size_t components;  // samples per voxel
  size_t sample_bytes;
  bool ChannelSet::*member;

  constexpr size_t bytes() const { return components * sample_bytes; }  // per voxel
  constexpr bool is_id() const { return kind == ChannelKind::kId; }
  // Measured at the voxel's own place. A voxel of the inside has its own value; of other channels
  // it has that of the nearest voxel of the surface.
  constexpr bool is_measure() const {
    return kind == ChannelKind::kDistance || kind == ChannelKind::kFraction;
  }
};

inline constexpr std::array<ChannelInfo, kChannelCount> kChannels = {{
    {Channel::kColor, "color", ChannelKind::kColor, 4, 1, &ChannelSet::color},
    {Channel::kNormal, "normal", ChannelKind::kVector, 3, 1, &ChannelSet::normal},
    {Channel::kMaterial, "material", ChannelKind::kId, 1, 2, &ChannelSet::material},
    {Channel::kLabel, "label", ChannelKind::kId, 1, 2, &ChannelSet::label},
    {Channel::kDistance, "distance", ChannelKind::kDistance, 1, 2, &ChannelSet::distance},
    {Channel::kCoverage, "coverage", ChannelKind::kFraction, 1, 1, &ChannelSet::coverage},
}};

constexpr const ChannelInfo& channel_info(Channel channel) {
  return kChannels[static_cast<size_t>(channel)];
}

constexpr bool ChannelSet::has(Channel channel) const {
  return this->*channel_info(channel).member;
}
constexpr void ChannelSet::set(Channel channel, bool on) {
  this->*channel_info(channel).member = on;
}
constexpr bool ChannelSet::any() const {
  return count() > 0;
}
constexpr size_t ChannelSet::count() const {
  size_t count = 0;
  for (const ChannelInfo& info : kChannels) count += has(info.channel) ? 1 : 0;
  return count;
}

// Bytes of one voxel's attributes.
constexpr size_t attribute_bytes(const ChannelSet& channels) {
  size_t bytes = 0;
  for (const ChannelInfo& info : kChannels) bytes += channels.has(info.channel) ? info.bytes() : 0;
  return bytes;
}

// Converts a set to bits, one per channel by its number, and back. Bits without a channel are
// dropped.
constexpr uint32_t channel_bits(const ChannelSet& channels) {
  uint32_t bits = 0;
  for (size_t i = 0; i < kChannelCount; ++i) bits |= channels.has(kChannels[i].channel) << i;
  return bits;
}
constexpr ChannelSet channels_of_bits(uint32_t bits) {
  ChannelSet channels;
  for (size_t i = 0; i < kChannelCount; ++i)
    channels.set(kChannels[i].channel, (bits >> i & 1) != 0);
  return channels;
}

}  // namespace voxeld
