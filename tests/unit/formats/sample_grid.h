// Grids that the tests of the formats write.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "proto/options/options.h"
#include "server/grid/grid.h"
#include "tests/unit/proto/tile_maker.h"

namespace voxeld::test {

inline OutputOptions to(Format format) {
  OutputOptions options;
  options.format = format;
  return options;
}

inline Grid grid_of(const std::array<int, 3>& dims, const std::vector<TestVoxel>& voxels,
                    const ChannelSet& channels) {
  Grid grid;
  grid.spec.dims = {dims[0], dims[1], dims[2]};
  grid.spec.origin_world = {-1.5, 0.25, 1e10};
  grid.spec.voxel_size = {0.5, 0.25, 0.125};
  grid.channels = channels;
  grid.meta = GridMeta::parse(R"({"units":"mm"})");
  grid.tiles = tiles_of(voxels, channels);
  normalize_tiles(grid);
  return grid;
}
inline Grid grid_of(const std::array<int, 3>& dims, const std::vector<TestVoxel>& voxels,
                    bool has_color, bool has_normal) {
  return grid_of(dims, voxels, {.color = has_color, .normal = has_normal});
}

// A full brick of cells 8..15 beside one voxel with attributes at cell 0,0,0; 512 + 1 voxels.
inline Grid grid_with_a_full_brick(bool has_color, bool has_normal) {
  Grid grid =
      grid_of({20, 17, 16}, {{{0, 0, 0}, {10, 20, 30, 255}, {0, 127, 0}}}, has_color, has_normal);
  grid.tiles[0].full = {{morton_encode(1, 1, 1), 0}};
  return grid;
}

inline Grid random_grid(uint32_t seed, const std::array<int, 3>& dims, int voxels, bool has_color,
                        bool has_normal) {
  std::mt19937 random(seed);
  return grid_of(dims, random_voxels(random, dims, voxels), has_color, has_normal);
}

}  // namespace voxeld::test
