// Fills of the devices against the oracle of tests/reference, cell for cell.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/bench/waves.h"
#include "tests/gpu/voxel/pipelines.h"
#include "tests/reference/solid_oracle.h"

namespace voxeld::pipelines {
namespace {

using reference::Occupancy;
using reference::OracleGrid;

std::vector<reference::Triangle> triangles_of(const Scene& scene) {
  std::vector<reference::Triangle> triangles;
  for (const MeshPart& part : scene.parts) {
    for (size_t i = 0; i + 2 < part.indices.size(); i += 3) {
      reference::Triangle triangle;
      for (size_t k = 0; k < 3; ++k) {
        const glm::dvec3& p = part.positions[part.indices[i + k]];
        triangle[k] = {p.x, p.y, p.z};
      }
      triangles.push_back(triangle);
    }
  }
  return triangles;
}

OracleGrid place_of(const Grid& grid) {
  const GridSpec& spec = grid.spec;
  return {{spec.dims.x, spec.dims.y, spec.dims.z},
          {spec.origin_world.x, spec.origin_world.y, spec.origin_world.z},
          {spec.voxel_size.x, spec.voxel_size.y, spec.voxel_size.z}};
}

Occupancy oracle(const Scene& scene, const OracleGrid& place, Sign sign) {
  const auto snapped = reference::snap_triangles(triangles_of(scene), place);
  if (sign == Sign::kParity) return reference::parity_cells(snapped, place, 2);
  if (sign == Sign::kMajority) return reference::majority_cells(snapped, place);
  if (sign == Sign::kNonzero) return reference::nonzero_cells(snapped, place);
  return reference::unreached_cells(reference::touched_cells(triangles_of(scene), place), place);
}

void expect_oracle(const Scene& scene, VoxelizeOptions options, const std::string& what) {
  options.fill = Fill::kSolid;
  options.rule = Rule::kNone;
  options.color = ColorMode::kNone;
  for (const Sign sign : {Sign::kParity, Sign::kNonzero, Sign::kMajority, Sign::kFlood}) {
    options.sign = sign;
    Occupancy expected;
    for (const PipelineChoice pipeline : {PipelineChoice::kCompute, PipelineChoice::kRaster}) {
      const Grid grid = voxelize(scene, options, pipeline);
      const OracleGrid place = place_of(grid);
      if (expected.empty()) expected = oracle(scene, place, sign);
      size_t wrong = 0, count = 0;
      for (const auto& [cell, voxel] : cells_of(grid)) {
        ++count;
        const auto index = static_cast<size_t>(cell[0]) +
                           static_cast<size_t>(place.dims[0]) *
                               (static_cast<size_t>(cell[1]) +
                                static_cast<size_t>(place.dims[1]) * static_cast<size_t>(cell[2]));
        wrong += expected.at(index) == 0 ? 1 : 0;
      }
      const std::string name = what + " sign " + std::to_string(static_cast<int>(sign)) +
                               " pipeline " + std::to_string(static_cast<int>(pipeline));
      EXPECT_EQ(wrong, 0u) << name;
      EXPECT_EQ(count, reference::count(expected)) << name;
    }
  }
}

TEST(SolidOracle, closed_meshes_are_filled_cell_for_cell) {
  VoxelizeOptions options;
  options.placement.size = 21;
  expect_oracle(wavy_sphere(1), options, "sphere");
}

TEST(SolidOracle, triangles_that_close_nothing_are_swept_cell_for_cell) {
  for (uint64_t seed = 1; seed < 4; ++seed) {
    const Scene scene = soup(seed, {.count = 40, .extent = 20, .size_max = 20});
    expect_oracle(scene, unit_cells({20, 17, 23}), "soup " + std::to_string(seed));
  }
}

TEST(SolidOracle, ties_are_decided_as_defined) {
  for (uint64_t seed = 1; seed < 4; ++seed) {
    Scene scene = soup(seed, {.count = 60, .extent = 12, .size_max = 12});
    for (glm::dvec3& p : scene.parts[0].positions) p = glm::round(p);
    expect_oracle(scene, unit_cells({12, 12, 12}), "ties " + std::to_string(seed));
  }
}

TEST(SolidOracle, grids_of_several_tiles_are_filled_cell_for_cell) {
  for (const std::array<int, 3> dims : {std::array{530, 9, 10}, {11, 300, 9}, {9, 10, 520}}) {
    const glm::dvec3 size(dims[0], dims[1], dims[2]);
    MeshPart part;
    add_box(part, size * 0.2, size * 0.8);
    expect_oracle(scene_of(std::move(part)), unit_cells(dims), std::to_string(dims[0]));
  }
}

}  // namespace
}  // namespace voxeld::pipelines
