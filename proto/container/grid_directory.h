// The directory of a native container, read entry by entry. GridReader reads and checks all of it;
// this is for readers that need a few of very many tiles and must not pay for the rest.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "proto/container/grid_format.h"
#include "proto/result.h"

namespace voxeld {

struct GridTileEntry {
  std::array<int32_t, 3> coord{};
  uint64_t offset = 0, bytes = 0;  // of the tile's streams, in the container
  uint64_t voxel_count = 0;
};

class GridDirectory {
 public:
  // `bytes` must outlive it. Errors: bad-request, "grid container, byte N: ...".
  static Result<GridDirectory> open(std::span<const uint8_t> bytes);

  const GridHeader& header() const { return header_; }  // without codecs and meta
  size_t tile_count() const { return tile_count_; }
  uint64_t voxel_count() const { return voxel_count_; }
  // The entry of a tile below tile_count(). Errors: bad-request if it lies outside the container.
  Result<GridTileEntry> tile(size_t index) const;

 private:
  GridDirectory() = default;

  std::span<const uint8_t> bytes_;
  GridHeader header_;
  size_t tile_count_ = 0, first_entry_ = 0;
  uint64_t voxel_count_ = 0;
};

}  // namespace voxeld
