// The assertion of every fuzz target of the files of voxels: an error with a message, or a grid
// that others can use without checks.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "proto/limits.h"
#include "server/base/check.h"
#include "server/volumes/volume.h"

namespace voxeld::fuzz {

inline void check_tile(const Grid& grid, const SparseTile& tile) {
  VOXELD_CHECK(!tile.empty(), "no empty tile");
  VOXELD_CHECK(tile.masks.size() == tile.brick_morton.size(), "a mask per brick");
  const size_t count = tile.attribute_count();
  for_each_channel(tile, [&](Channel channel, const auto& samples) {
    const size_t components = channel_info(channel).components;
    const size_t expected = grid.channels.has(channel) ? components * count : 0;
    VOXELD_CHECK(samples.size() == expected, "a sample per voxel");
  });
  for_each_voxel(tile, [&](int x, int y, int z, size_t /*voxel*/) {
    const auto& dims = grid.spec.dims;
    VOXELD_CHECK(x >= 0 && y >= 0 && z >= 0 && x < dims.x && y < dims.y && z < dims.z,
                 "cell in the grid");
  });
}

inline int check_volume(const Result<Volume>& volume) {
  if (!volume) {
    VOXELD_CHECK(!volume.error().detail.empty(), "an error says what");
    VOXELD_CHECK(volume.error().code != ErrorCode::kInternal, "input is never an internal error");
    return 0;
  }
  const Grid& grid = volume->grid;
  for (int c = 0; c < 3; ++c) {
    VOXELD_CHECK(grid.spec.dims[c] >= 1 && grid.spec.dims[c] <= limits::kGridSideMax, "dims");
    VOXELD_CHECK(std::isfinite(grid.spec.origin_world[c]), "finite origin");
    VOXELD_CHECK(grid.spec.voxel_size[c] > 0 && std::isfinite(grid.spec.voxel_size[c]),
                 "side of a voxel");
  }
  for (size_t i = 0; i < grid.tiles.size(); ++i) {
    VOXELD_CHECK(i == 0 || tile_order(grid.tiles[i - 1]) < tile_order(grid.tiles[i]),
                 "tiles ascend");
    check_tile(grid, grid.tiles[i]);
  }
  return 0;
}

}  // namespace voxeld::fuzz
