// The layout that writer and reader of the sequence container share;
// proto/container/sequence_format.h has the byte map.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include "proto/channels.h"
#include "proto/result.h"

namespace voxeld::sequence_layout {

inline constexpr char kSequenceMagic[8] = {'V', 'O', 'X', 'S', 'E', 'Q', '\0', '\0'};
inline constexpr size_t kReservedByte = 111;
inline constexpr size_t kFrameBytes = 24, kStreamBytes = 16;
inline constexpr size_t kTileStreamsByte = 24;  // in a tile's entry: numbers of its streams
inline constexpr uint32_t kNoStream = 0xffffffff;
// The octree's stream and one for each possible channel.
inline constexpr size_t kStreamKinds = 1 + kChannelCount;

// Bytes of one tile's entry in the index.
constexpr size_t tile_bytes(const ChannelSet& channels) {
  return (kTileStreamsByte + 4 * (1 + channels.count()) + 7) / 8 * 8;
}

inline Error broken_sequence(uint64_t byte, std::string detail, std::string expected = "",
                             std::string got = "") {
  return {ErrorCode::kBadRequest,
          "sequence container, byte " + std::to_string(byte) + ": " + std::move(detail),
          std::move(expected), std::move(got)};
}

// Converts an error of the grid container's decoder about a stream at `byte`.
inline Error broken_stream(uint64_t byte, Error error) {
  constexpr std::string_view kGrid = "grid container, ", kByte = "byte ", kColon = ": ";
  std::string& detail = error.detail;
  if (detail.starts_with(kGrid)) detail.erase(0, kGrid.size());
  if (detail.starts_with(kByte)) detail.erase(0, detail.find(kColon) + kColon.size());
  return broken_sequence(byte, std::move(detail), std::move(error.expected), std::move(error.got));
}

}  // namespace voxeld::sequence_layout
