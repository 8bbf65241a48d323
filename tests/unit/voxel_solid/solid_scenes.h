// Meshes and grids for the tests of fills.
#pragma once

#include <functional>
#include <vector>

#include "proto/options/options.h"
#include "server/grid/grid.h"
#include "server/scene/core/scene.h"
#include "server/voxel/voxelize.h"
#include "tests/reference/solid_oracle.h"

namespace voxeld::solid_test {

using reference::Occupancy;
using reference::OracleGrid;

Scene scene_of(const std::vector<reference::Triangle>& triangles);
std::vector<reference::Triangle> triangles_of(const Scene& scene);
// The scene with every position changed, and with fewer triangles.
Scene moved(const Scene& scene, const std::function<glm::dvec3(const glm::dvec3&)>& move);
Scene without(const Scene& scene, const std::function<bool(const glm::dvec3& centre)>& drop);
Scene joined(const Scene& a, const Scene& b);
// Axis-parallel, wound outwards.
Scene box(const glm::dvec3& min, const glm::dvec3& max);
// `count` triangles anywhere in the box, large and small.
Scene soup(int count, const glm::dvec3& size, unsigned seed);

// fill=solid, rule=none.
VoxelizeOptions solid(Sign sign);
// Cells of voxel size 1 from `min` to `max`.
void set_bounds(VoxelizeOptions& options, const glm::dvec3& min, const glm::dvec3& max);

Grid voxelized(const Scene& scene, const VoxelizeOptions& options, VoxelizeStats* stats = nullptr,
               int threads = 2);
OracleGrid oracle_grid(const Grid& grid);
Occupancy cells_of(const Grid& grid);
// The number of cells in which the two differ.
size_t differences(const Occupancy& a, const Occupancy& b);

}  // namespace voxeld::solid_test
