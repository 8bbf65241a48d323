// Fills against the oracle, voxel for voxel.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/bench/waves.h"
#include "tests/unit/long_form.h"
#include "tests/unit/voxel_solid/solid_scenes.h"

namespace voxeld {
namespace {

using namespace solid_test;

VoxelizeOptions of_size(VoxelizeOptions options, int size) {
  options.placement.size = size;
  return options;
}

Occupancy oracle(const Scene& scene, const Grid& grid, Sign sign) {
  const OracleGrid place = oracle_grid(grid);
  const auto snapped = reference::snap_triangles(triangles_of(scene), place);
  switch (sign) {
    case Sign::kParity:
      return reference::parity_cells(snapped, place, 2);
    case Sign::kMajority:
      return reference::majority_cells(snapped, place);
    case Sign::kFlood:
      return reference::unreached_cells(reference::touched_cells(triangles_of(scene), place),
                                        place);
    default:
      return reference::nonzero_cells(snapped, place);
  }
}

constexpr Sign kExactSigns[] = {Sign::kParity, Sign::kNonzero, Sign::kMajority, Sign::kFlood};

TEST(SolidOracle, closed_meshes_are_filled_voxel_for_voxel) {
  const Scene scene = wavy_sphere(2);
  for (const Sign sign : kExactSigns) {
    const Grid grid = voxelized(scene, of_size(solid(sign), 37));
    const Occupancy expected = oracle(scene, grid, sign);
    EXPECT_GT(reference::count(expected), 5000u);
    EXPECT_EQ(differences(cells_of(grid), expected), 0u) << static_cast<int>(sign);
  }
}

TEST(SolidOracle, closed_meshes_have_one_inside_by_parity_nonzero_majority_and_winding) {
  const Scene scene = wavy_sphere(3);
  const Occupancy parity = cells_of(voxelized(scene, of_size(solid(Sign::kParity), 90)));
  for (const Sign sign : {Sign::kNonzero, Sign::kMajority, Sign::kWinding, Sign::kAuto}) {
    const Grid grid = voxelized(scene, of_size(solid(sign), 90));
    EXPECT_EQ(differences(cells_of(grid), parity), 0u) << static_cast<int>(sign);
  }
  // The flood stops at the surface, which stands on both sides of it.
  VoxelizeOptions options = of_size(solid(Sign::kFlood), 90);
  const Occupancy flood = cells_of(voxelized(scene, options));
  options.sign = Sign::kParity;
  options.rule = Rule::kTouch;
  EXPECT_EQ(differences(cells_of(voxelized(scene, options)), flood), 0u);
}

TEST(SolidOracle, triangles_that_close_nothing_are_swept_voxel_for_voxel) {
  for (unsigned seed = 1; seed < 6; ++seed) {
    const Scene scene = soup(40, glm::dvec3(20, 17, 23), seed);
    for (const Sign sign : kExactSigns) {
      const Grid grid = voxelized(scene, of_size(solid(sign), 23));
      EXPECT_EQ(differences(cells_of(grid), oracle(scene, grid, sign)), 0u)
          << "seed " << seed << " sign " << static_cast<int>(sign);
    }
  }
}

// Corners on a coarse lattice: sides, corners and planes through the centres of cells.
TEST(SolidOracle, ties_are_decided_as_defined) {
  for (unsigned seed = 1; seed < 9; ++seed) {
    const Scene coarse =
        moved(soup(60, glm::dvec3(12.0), seed), [](const glm::dvec3& p) { return glm::round(p); });
    VoxelizeOptions options = solid(Sign::kParity);
    set_bounds(options, glm::dvec3(0), glm::dvec3(12));
    // Snapping moves corners by half a sub-voxel on all axes: differences stay whole cells.
    for (const Sign sign : kExactSigns) {
      options.sign = sign;
      const Grid grid = voxelized(coarse, options);
      EXPECT_EQ(differences(cells_of(grid), oracle(coarse, grid, sign)), 0u)
          << "seed " << seed << " sign " << static_cast<int>(sign);
    }
  }
}

TEST(SolidOracle, grids_of_several_tiles_on_each_axis) {
  for (const glm::ivec3& dims :
       {glm::ivec3(530, 9, 10), glm::ivec3(11, 300, 9), glm::ivec3(9, 10, 520)}) {
    const glm::dvec3 size(dims);
    const Scene scene = joined(soup(14, size, 3), box(size * 0.2, size * 0.8));
    VoxelizeOptions options = solid(Sign::kParity);
    set_bounds(options, glm::dvec3(0), size);
    for (const Sign sign : kExactSigns) {
      options.sign = sign;
      const Grid grid = voxelized(scene, options);
      ASSERT_EQ(grid.spec.dims, dims);
      EXPECT_EQ(differences(cells_of(grid), oracle(scene, grid, sign)), 0u)
          << "x " << dims.x << " sign " << static_cast<int>(sign);
    }
  }
}

// Winding numbers within this of 1/2 may be decided either way.
constexpr long double kTolerance = 1e-6L;

void expect_winding(const Scene& scene, const VoxelizeOptions& options, size_t near_max) {
  const Grid grid = voxelized(scene, options);
  const OracleGrid place = oracle_grid(grid);
  const auto snapped = reference::snap_triangles(triangles_of(scene), place);
  const Occupancy cells = cells_of(grid);
  const Occupancy touched = reference::touched_cells(triangles_of(scene), place);
  size_t wrong = 0, near = 0, i = 0;
  for (int z = 0; z < place.dims[2]; ++z) {
    for (int y = 0; y < place.dims[1]; ++y) {
      for (int x = 0; x < place.dims[0]; ++x, ++i) {
        if (touched[i] != 0) continue;  // on the surface the number jumps
        const long double winding = reference::winding_number(snapped, {x, y, z});
        if (std::abs(winding - 0.5L) < kTolerance) {
          ++near;
        } else {
          wrong += (winding > 0.5L) != (cells[i] != 0);
        }
      }
    }
  }
  EXPECT_EQ(wrong, 0u);
  EXPECT_LE(near, near_max);
}

TEST(SolidOracle, winding_numbers_of_meshes_with_holes) {
  const Scene sphere = wavy_sphere(3);
  // The oracle takes seconds for each; the next test has small holes.
  for (const double cut : by_form<double>({-0.2}, {0.8, 0.3, -0.2})) {
    const Scene open = without(sphere, [&](const glm::dvec3& c) { return c.z + 0.3 * c.x > cut; });
    expect_winding(open, of_size(solid(Sign::kWinding), 31), 0);
  }
}

TEST(SolidOracle, winding_numbers_of_many_holes) {
  const Scene open = without(
      wavy_sphere(3), [](const glm::dvec3& c) { return std::sin(40 * c.x + 13 * c.y) > 0.6; });
  expect_winding(open, of_size(solid(Sign::kWinding), 30), 2);
}

TEST(SolidOracle, winding_numbers_of_parts_that_overlap_and_are_inside_out) {
  const Scene sphere = wavy_sphere(2);
  const Scene shifted =
      moved(sphere, [](const glm::dvec3& p) { return p + glm::dvec3(0.7, 0, 0); });
  const Scene inverted =
      moved(sphere, [](const glm::dvec3& p) { return glm::dvec3(-0.4, 0.4, 0.4) * p; });
  const Scene all = without(joined(joined(sphere, shifted), inverted),
                            [](const glm::dvec3& c) { return c.y > 0.7; });
  expect_winding(all, of_size(solid(Sign::kWinding), 30), 0);
}

TEST(SolidOracle, shells_contain_only_cells_near_the_surface) {
  const Scene scene = wavy_sphere(2);
  for (const double thickness : {1.0, std::sqrt(2.0), 2.0, 2.3, 5.0, 30.0}) {
    VoxelizeOptions options = of_size(solid(Sign::kParity), 30);
    options.fill = Fill::kShell;
    options.thickness = thickness;
    options.rule = Rule::kTouch;
    const Grid grid = voxelized(scene, options);
    const OracleGrid place = oracle_grid(grid);
    const Occupancy surface = reference::touched_cells(triangles_of(scene), place);
    Occupancy expected =
        reference::near_cells(oracle(scene, grid, Sign::kParity), surface, thickness, place);
    for (size_t i = 0; i < expected.size(); ++i) expected[i] |= surface[i];
    EXPECT_EQ(differences(cells_of(grid), expected), 0u) << thickness;
    // Without the surface, its cells stay only where they are inside.
    options.rule = Rule::kNone;
    const Occupancy inner =
        reference::near_cells(oracle(scene, grid, Sign::kParity), surface, thickness, place);
    EXPECT_EQ(differences(cells_of(voxelized(scene, options)), inner), 0u) << thickness;
  }
}

}  // namespace
}  // namespace voxeld
