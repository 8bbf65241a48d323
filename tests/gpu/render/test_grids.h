// Small grids made in place, so that the renderer is tested without loaders and voxelizers.
#pragma once

#include <functional>
#include <glm/vec3.hpp>
#include <optional>

#include "server/grid/grid.h"

namespace voxeld {

struct TestVoxel {
  std::array<uint8_t, 4> color{};
  std::array<int8_t, 3> normal{};
};
// nullopt: the cell is empty.
using VoxelAt = std::function<std::optional<TestVoxel>(const glm::ivec3& cell)>;

Grid make_test_grid(const GridSpec& spec, bool has_color, bool has_normal, const VoxelAt& at);

// A shell one voxel thick around the middle of the grid, coloured and with normals.
Grid sphere_grid(int side, bool has_color, bool has_normal);
// Each cell occupied with the given probability.
Grid noise_grid(const GridSpec& spec, double density, uint32_t seed);

}  // namespace voxeld
