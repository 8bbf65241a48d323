// Grids that the tests of the formats write.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "server/grid/grid.h"
#include "tests/unit/proto/tile_maker.h"

namespace voxeld::test {

inline Grid grid_of(const std::array<int, 3>& dims, const std::vector<TestVoxel>& voxels,
                    bool has_color, bool has_normal) {
  Grid grid;
  grid.spec.dims = {dims[0], dims[1], dims[2]};
  grid.spec.origin_world = {-1.5, 0.25, 1e10};
  grid.spec.voxel_size = {0.5, 0.25, 0.125};
  grid.has_color = has_color;
  grid.has_normal = has_normal;
  grid.meta_json = R"({"units":"mm"})";
  grid.tiles = tiles_of(voxels, has_color, has_normal);
  normalize_tiles(grid);
  return grid;
}

inline Grid random_grid(uint32_t seed, const std::array<int, 3>& dims, int voxels, bool has_color,
                        bool has_normal) {
  std::mt19937 random(seed);
  return grid_of(dims, random_voxels(random, dims, voxels), has_color, has_normal);
}

}  // namespace voxeld::test
