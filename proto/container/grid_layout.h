// The layout that writer and reader of the native container share; proto/container/grid_format.h
// has the byte map.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "proto/container/grid_format.h"
#include "proto/limits.h"

namespace voxeld::grid_layout {

static_assert(std::endian::native == std::endian::little, "the container is little-endian");

inline constexpr char kGridMagic[8] = {'V', 'O', 'X', 'G', 'R', 'I', 'D', '\0'};
inline constexpr uint32_t kTileLog2 = 8;
inline constexpr uint32_t kTileBricksMax = 1u << 3 * (kTileLog2 - 3);
inline constexpr size_t kCodecsByte = 104, kCodecs = 1 + kChannelCount;
inline constexpr size_t kEntryStreamsByte = 36;  // in an entry: bytes of its channels' streams
inline constexpr uint64_t kTileVoxelsMax = uint64_t{1} << (3 * kTileLog2);
inline constexpr size_t kMetaBytesMax = size_t{1} << 24;

template <typename T>
void put(std::vector<uint8_t>& out, size_t at, T value) {
  std::memcpy(out.data() + at, &value, sizeof value);
}

template <typename T>
T get(std::span<const uint8_t> bytes, size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

inline size_t padded(size_t bytes) {
  return (bytes + 7) & ~size_t{7};
}

inline Error broken_grid(uint64_t byte, std::string detail, std::string expected = "",
                         std::string got = "") {
  return {ErrorCode::kBadRequest,
          "grid container, byte " + std::to_string(byte) + ": " + std::move(detail),
          std::move(expected), std::move(got)};
}

inline uint32_t tile_order(const std::array<int32_t, 3>& coord) {
  return morton_encode(static_cast<uint32_t>(coord[0]), static_cast<uint32_t>(coord[1]),
                       static_cast<uint32_t>(coord[2]));
}

inline bool inside(const std::array<int32_t, 3>& coord, const std::array<int32_t, 3>& dims) {
  for (size_t c = 0; c < 3; ++c) {
    const int tiles = (dims[c] + limits::kTileSide - 1) / limits::kTileSide;
    if (coord[c] < 0 || coord[c] >= tiles) return false;
  }
  return true;
}

inline Status check_header(const GridHeader& header, uint64_t byte) {
  for (size_t c = 0; c < 3; ++c) {
    if (header.dims[c] < 1 || header.dims[c] > limits::kGridSideMax) {
      return broken_grid(byte, "dims", "1 to " + std::to_string(limits::kGridSideMax),
                         std::to_string(header.dims[c]));
    }
    if (!std::isfinite(header.origin[c])) return broken_grid(byte, "origin is not finite");
    if (!std::isfinite(header.voxel_size[c]) || header.voxel_size[c] <= 0) {
      return broken_grid(byte, "voxel size", "a finite number above 0",
                         std::to_string(header.voxel_size[c]));
    }
  }
  return {};
}

// Checks that all voxels of the tile lie inside dims.
Status check_cells(const SparseTile& tile, const std::array<int32_t, 3>& dims);

}  // namespace voxeld::grid_layout
