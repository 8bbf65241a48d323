// Distances against the oracle, cell for cell.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <map>
#include <random>

#include "server/base/cancel_point.h"
#include "server/voxel/solid/distance/distance_field.h"
#include "tests/bench/waves.h"
#include "tests/reference/distance_oracle.h"
#include "tests/unit/voxel_solid/solid_scenes.h"

namespace voxeld {
namespace {

using solid_test::cells_of;
using solid_test::differences;
using solid_test::joined;
using solid_test::moved;
using solid_test::Occupancy;
using solid_test::oracle_grid;
using solid_test::OracleGrid;
using solid_test::triangles_of;
using solid_test::voxelized;
using Corners = std::vector<glm::ivec3>;  // q, three for each triangle

constexpr int kTooFar = 40000;  // what cells beside the band have in a dense array

// Large and small triangles, some without area, around a box of 24 cells.
Corners corner_soup(int count, unsigned seed) {
  std::mt19937 random(seed);
  const auto below = [&](int limit) {
    return static_cast<int>(random() % static_cast<unsigned>(limit));
  };
  Corners corners;
  for (int t = 0; t < count; ++t) {
    const int extent = t % 3 == 0 ? 5000 : 400;
    const glm::ivec3 at(below(6144), below(6144), below(6144));
    for (int i = 0; i < 3; ++i) {
      corners.push_back(at + glm::ivec3(below(extent), below(extent), below(extent)) - extent / 2);
    }
    if (t % 7 == 3) corners.back() = corners[corners.size() - 2];
    if (t % 11 == 5) corners.back() = 2 * corners[corners.size() - 2] - corners[corners.size() - 3];
  }
  return corners;
}

reference::SnappedTriangles oracle_triangles(const Corners& corners) {
  reference::SnappedTriangles triangles(corners.size() / 3);
  for (size_t i = 0; i < corners.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      triangles[i / 3][i % 3][static_cast<size_t>(c)] = 2 * corners[i][c] + 1;
    }
  }
  return triangles;
}

struct Dense {
  glm::ivec3 dims;
  std::vector<int> values;
  int& at(int x, int y, int z) {
    return values[static_cast<size_t>((z * dims.y + y) * dims.x + x)];
  }
};

Dense dense_of(const std::vector<DistanceTile>& tiles, const glm::ivec3& dims) {
  Dense dense{dims, std::vector<int>(static_cast<size_t>(dims.x * dims.y * dims.z), kTooFar)};
  for (const DistanceTile& tile : tiles) {
    EXPECT_EQ(tile.tile.attribute_count(), tile.distance.size());
    EXPECT_TRUE(std::ranges::is_sorted(tile.tile.brick_morton));
    for_each_voxel(tile.tile, [&](int x, int y, int z, size_t i) {
      ASSERT_LT(i, tile.distance.size());
      ASSERT_TRUE(x < dims.x && y < dims.y && z < dims.z);
      dense.at(x, y, z) = tile.distance[i];
    });
  }
  return dense;
}

Dense band(const Corners& corners, const glm::ivec3& dims, double thickness,
           const std::vector<SparseTile>& inside = {}, int threads = 2) {
  const FillMesh mesh = FillMesh::of(corners, 8);
  const TriangleTree tree(mesh);
  const BrickIndex index(inside, dims);
  ThreadTeam team(threads);
  std::vector<DistanceTile> tiles;
  EXPECT_TRUE(find_band({tree, dims, index}, thickness, team, {}, tiles).ok());
  Dense dense = dense_of(tiles, dims);
  const auto count = std::ranges::count_if(dense.values, [](int v) { return v != kTooFar; });
  EXPECT_LE(count, band_cells_max(mesh, dims, thickness));
  return dense;
}

void expect_like_oracle(const Corners& corners, const glm::ivec3& dims, double thickness) {
  Dense dense = band(corners, dims, thickness);
  const auto triangles = oracle_triangles(corners);
  size_t in_band = 0;
  for (int z = 0; z < dims.z; ++z) {
    for (int y = 0; y < dims.y; ++y) {
      for (int x = 0; x < dims.x; ++x) {
        const long double distance = reference::surface_distance(triangles, {x, y, z});
        const long double steps = distance / 4;
        const int got = dense.at(x, y, z);
        // Distances that doubles cannot tell apart may go either way.
        if (std::abs(distance - static_cast<long double>(thickness) * 512) < 1e-6L) continue;
        if (distance > static_cast<long double>(thickness) * 512) {
          ASSERT_EQ(got, kTooFar) << x << " " << y << " " << z;
          continue;
        }
        ++in_band;
        ASSERT_NE(got, kTooFar) << x << " " << y << " " << z;
        ASSERT_LE(std::abs(got - steps), 0.5L + 1e-6L) << x << " " << y << " " << z;
      }
    }
  }
  EXPECT_GT(in_band, 0u);
}

TEST(Distance, a_band_is_every_cell_within_the_thickness_with_its_exact_distance) {
  expect_like_oracle(corner_soup(40, 1), {24, 24, 24}, 1);
  expect_like_oracle(corner_soup(40, 2), {24, 21, 23}, 2.5);
  expect_like_oracle(corner_soup(6, 3), {31, 9, 24}, 3);
  expect_like_oracle(corner_soup(3, 4), {24, 24, 24}, 20);
  expect_like_oracle(corner_soup(1, 5), {24, 1, 24}, 256);
}

TEST(Distance, a_face_beside_the_grid_is_as_near_as_it_is) {
  // x = -3 + 1/512 voxels, far larger than the grid: cells of x = 0 are 3.5 away, less that.
  const Corners face = {{-768, -90000, -90000}, {-768, 90000, -90000}, {-768, 0, 190000}};
  Dense dense = band(face, {8, 8, 8}, 4.5);
  EXPECT_EQ(dense.at(0, 3, 3), 448);  // 3.498 voxels
  EXPECT_EQ(dense.at(0, 7, 0), 448);
  EXPECT_EQ(dense.at(1, 3, 3), 576);
  EXPECT_EQ(dense.at(2, 3, 3), kTooFar);
}

TEST(Distance, cells_inside_are_negative_and_the_distance_is_the_same) {
  const Corners corners = corner_soup(9, 6);
  SparseTile inside;
  inside.brick_morton = {0};
  inside.masks = {BrickMask{{0xff00ff00ff00ff00, 1, 2, 3, 4, 5, 6, 7}}};
  inside.full = {{1, 0}};
  Dense plain = band(corners, {24, 24, 24}, 8),
        with_sign = band(corners, {24, 24, 24}, 8, {inside});
  size_t negative = 0;
  for (int z = 0; z < 8; ++z) {
    for (int y = 0; y < 8; ++y) {
      for (int x = 0; x < 16; ++x) {
        if (plain.at(x, y, z) == kTooFar) continue;
        const uint32_t i = morton_encode(x & 7, y, z);
        const bool is_inside = x >= 8 || (inside.masks[0].words[i / 64] >> (i % 64) & 1) != 0;
        negative += is_inside ? 1 : 0;
        EXPECT_EQ(with_sign.at(x, y, z),
                  is_inside ? -std::max(plain.at(x, y, z), 1) : plain.at(x, y, z));
      }
    }
  }
  EXPECT_GT(negative, 20u);
  EXPECT_EQ(plain.at(20, 20, 20), with_sign.at(20, 20, 20));
}

TEST(Distance, a_line_through_far_corners_is_as_near_as_it_is) {
  // Three corners on a line along (3, 5, 7) a million cells long, through (2, 2, 2) + 1/512.
  const glm::ivec3 at(512, 512, 512), along(3, 5, 7);
  const Corners line = {at - 30'000'000 * along, at + 35'000'001 * along, at + 12'345'678 * along};
  Dense dense = band(line, {5, 5, 5}, 2);
  const glm::dvec3 direction = glm::normalize(glm::dvec3(along));
  for (int z = 0; z < 5; ++z) {
    for (int y = 0; y < 5; ++y) {
      for (int x = 0; x < 5; ++x) {
        const glm::dvec3 p = glm::dvec3(x, y, z) - 1.5 - 1.0 / 512;
        const double distance = glm::length(p - glm::dot(p, direction) * direction);
        const int steps = static_cast<int>(std::floor(distance * 128 + 0.5));
        ASSERT_NEAR(dense.at(x, y, z), distance <= 2 ? steps : kTooFar, 1) << x << y << z;
      }
    }
  }
}

TEST(Distance, a_centre_on_the_surface_keeps_its_sign) {
  // x = 1.5 voxels - 1/512: nearer to the centres of x = 1 than 16 bits tell.
  const Corners face = {{383, -9000, -9000}, {383, 9000, -9000}, {383, 0, 19000}};
  SparseTile inside;
  inside.full = {{0, 0}};
  EXPECT_EQ(band(face, {8, 8, 8}, 1).at(1, 3, 3), 0);
  EXPECT_EQ(band(face, {8, 8, 8}, 1, {inside}).at(1, 3, 3), -1);
}

TEST(Distance, threads_and_orders_of_triangles_and_corners_do_not_matter) {
  const Corners corners = corner_soup(60, 7);
  const Dense one = band(corners, {24, 24, 24}, 3, {}, 1);
  Corners turned;
  for (size_t t = corners.size() / 3; t-- > 0;) {
    for (const size_t i : {2, 0, 1}) turned.push_back(corners[3 * t + i]);
  }
  EXPECT_EQ(one.values, band(turned, {24, 24, 24}, 3, {}, 3).values);
}

TEST(Distance, whole_voxels_of_translation_shift_the_band_across_tiles) {
  const Corners corners = corner_soup(20, 8);
  Dense here = band(corners, {30, 30, 30}, 3);
  Corners moved = corners;
  const glm::ivec3 by(245, 250, 3);
  for (glm::ivec3& q : moved) q += by * 256;
  Dense there = band(moved, {30 + 245, 30 + 250, 33}, 3);
  for (int z = 0; z < 30; ++z) {
    for (int y = 0; y < 30; ++y) {
      for (int x = 0; x < 30; ++x) {
        ASSERT_EQ(here.at(x, y, z), there.at(x + by.x, y + by.y, z + by.z));
      }
    }
  }
}

TEST(Distance, voxels_of_masks_have_theirs_however_far_they_are) {
  const Corners corners = corner_soup(5, 9);
  const FillMesh mesh = FillMesh::of(corners, 8);
  const TriangleTree tree(mesh);
  SparseTile tile;
  std::mt19937_64 random(10);
  for (uint32_t brick = 0; brick < 1500; brick += 7) {
    tile.brick_morton.push_back(brick);
    tile.masks.push_back(BrickMask{{random() & random(), 0, 0, random(), 0, 0, 0, 1}});
  }
  const BrickIndex nothing({}, {256, 256, 256});
  ThreadTeam team(3);
  const auto distances = distances_of_tile({tree, {256, 256, 256}, nothing}, tile, team);
  ASSERT_EQ(distances.size(), tile.attribute_count());
  const auto triangles = oracle_triangles(corners);
  for_each_voxel(tile, [&](int x, int y, int z, size_t i) {
    ASSERT_LE(std::abs(distances[i] - reference::surface_distance(triangles, {x, y, z}) / 4),
              0.5L + 1e-6L);
  });
}

TEST(Distance, distances_beyond_16_bits_are_clamped) {
  const TriangleTree tree(FillMesh::of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, 8));
  SparseTile tile;
  tile.coord = {1, 0, 0};
  tile.brick_morton = {7};
  tile.masks = {BrickMask{{1}}};
  const BrickIndex nothing({}, {512, 256, 256});
  ThreadTeam team(1);
  EXPECT_EQ(distances_of_tile({tree, {512, 256, 256}, nothing}, tile, team),
            std::vector<int16_t>{32767});
}

TEST(Distance, in_stretched_space_is_the_oracles_also_of_triangles_without_area) {
  for (const glm::dvec3& edges :
       {glm::dvec3(1, 2.5, 7.1), glm::dvec3(1.75, 1, 1), glm::dvec3(256, 1, 30)}) {
    const Corners corners = corner_soup(40, 12);
    Corners turned;
    for (size_t t = corners.size() / 3; t-- > 0;) {
      for (const size_t i : {2, 0, 1}) turned.push_back(corners[3 * t + i]);
    }
    TriangleTree tree(FillMesh::of(corners, 8)), other(FillMesh::of(turned, 8));
    tree.set_scale(edges);
    other.set_scale(edges);
    SparseTile tile;
    std::mt19937_64 random(13);
    for (uint32_t brick = 0; brick < 80; ++brick) {
      tile.brick_morton.push_back(brick);
      tile.masks.push_back(BrickMask{{random() & random(), 0, random() & random(), 1}});
    }
    const glm::ivec3 dims(256);
    const BrickIndex nothing({}, dims);
    ThreadTeam team(3), alone(1);
    const auto distances = distances_of_tile({tree, dims, nothing}, tile, team);
    ASSERT_EQ(distances.size(), tile.attribute_count());
    EXPECT_EQ(distances, distances_of_tile({other, dims, nothing}, tile, alone));
    const auto triangles = oracle_triangles(corners);
    size_t near = 0;
    for_each_voxel(tile, [&](int x, int y, int z, size_t i) {
      const long double exact =
          reference::surface_distance(triangles, {x, y, z}, {edges.x, edges.y, edges.z}) / 4;
      near += exact < 32767 ? 1 : 0;
      ASSERT_LE(std::abs(distances[i] - std::min(exact, 32767.0L)), 0.5L + 1e-6L)
          << x << " " << y << " " << z;
    });
    EXPECT_GT(near, 200u);
  }
}

VoxelizeOptions band_options(double thickness, int size) {
  VoxelizeOptions options;
  options.placement.size = size;
  options.placement.padding = 4;
  options.fill = Fill::kBand;
  options.thickness = thickness;
  options.color = ColorMode::kNone;
  return options;
}

TEST(Band, a_band_is_the_cells_near_the_surface_on_both_sides_by_every_rule) {
  const Scene scene = wavy_sphere(2);
  const Grid grid = voxelized(scene, band_options(2, 26));
  const auto snapped = reference::snap_triangles(triangles_of(scene), oracle_grid(grid));
  Occupancy expected;
  for (int z = 0; z < grid.spec.dims.z; ++z) {
    for (int y = 0; y < grid.spec.dims.y; ++y) {
      for (int x = 0; x < grid.spec.dims.x; ++x) {
        expected.push_back(reference::surface_distance(snapped, {x, y, z}) <= 2 * 512 ? 1 : 0);
      }
    }
  }
  EXPECT_EQ(differences(cells_of(grid), expected), 0u);
  for (const Rule rule : {Rule::kThin, Rule::kCenter, Rule::kNone}) {
    VoxelizeOptions options = band_options(2, 26);
    options.rule = rule;
    EXPECT_TRUE(voxelized(scene, options).tiles == grid.tiles);
  }
}

TEST(Band, the_thinnest_holds_every_voxel_that_the_surface_touches) {
  const Scene scene = joined(solid_test::soup(60, glm::dvec3(2), 11), wavy_sphere(2));
  VoxelizeOptions options = band_options(1, 40);
  const Occupancy near = cells_of(voxelized(scene, options));
  options.fill = Fill::kSurface;
  const Occupancy touched = cells_of(voxelized(scene, options));
  for (size_t i = 0; i < near.size(); ++i) ASSERT_LE(touched[i], near[i]);
}

TEST(Band, surface_voxels_keep_their_attributes_and_the_others_have_none) {
  VoxelizeOptions options = band_options(3, 40);
  options.color = ColorMode::kAxis;
  const Scene scene = wavy_sphere(2);
  const Grid band = voxelized(scene, options);
  options.fill = Fill::kSurface;
  const Grid surface = voxelized(scene, options);
  std::map<std::array<int, 3>, uint32_t> colors;
  for_each_voxel(surface.tiles.front(), [&](int x, int y, int z, size_t i) {
    std::memcpy(&colors[{x, y, z}], &surface.tiles.front().color[4 * i], 4);
  });
  size_t seen = 0;
  for_each_voxel(band.tiles.front(), [&](int x, int y, int z, size_t i) {
    if (i == kNoAttributes) return;
    uint32_t color = 0;
    std::memcpy(&color, &band.tiles.front().color[4 * i], 4);
    const auto at = colors.find({x, y, z});
    EXPECT_EQ(color, at == colors.end() ? 0u : at->second);
    seen += at == colors.end() ? 0 : 1;
  });
  EXPECT_EQ(seen, colors.size());
}

TEST(Band, a_band_costs_at_most_its_estimate_and_is_refused_above) {
  Voxelizer voxelizer(nullptr, 2);
  const Scene scene = wavy_sphere(3);
  const auto estimate = voxelizer.estimate(scene, band_options(8, 100));
  ASSERT_TRUE(estimate.ok());
  voxelizer.set_host_bytes_max(estimate->host_bytes);
  const auto grid = voxelizer.voxelize(scene, band_options(8, 100), {}, nullptr);
  ASSERT_TRUE(grid.ok()) << grid.error().message();
  size_t bytes = 0;
  for (const SparseTile& tile : grid->tiles) {
    bytes += tile.masks.size() * (sizeof(BrickMask) + sizeof(uint32_t));
    bytes += tile.full.size() * sizeof(FullNode) + 2 * tile.distance.size();
  }
  EXPECT_GT(bytes, 0u);
  EXPECT_LE(static_cast<int64_t>(bytes), estimate->host_bytes);
  voxelizer.set_host_bytes_max(estimate->host_bytes - 1);
  const auto refused = voxelizer.voxelize(scene, band_options(8, 100), {}, nullptr);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kGridTooLarge);
}

// The distance that the grid stores for each voxel; voxels of full nodes have none.
std::map<std::array<int, 3>, int> distances_of(const Grid& grid) {
  std::map<std::array<int, 3>, int> all;
  for (const SparseTile& tile : grid.tiles) {
    EXPECT_EQ(tile.distance.size(), tile.attribute_count());
    for_each_voxel(tile, [&](int x, int y, int z, size_t i) {
      if (i != kNoAttributes) all[{x, y, z}] = tile.distance[i];
    });
  }
  return all;
}

TEST(Band, its_estimate_and_its_tree_can_be_cancelled) {
  const FillMesh mesh = FillMesh::of(corner_soup(30, 7), limits::kSubVoxelBits);
  const std::atomic<bool> flag{true};
  const CancelScope scope(flag);
  EXPECT_THROW((void)band_cells_max(mesh, glm::ivec3(24), 3), Cancelled);
  EXPECT_THROW((void)TriangleTree(mesh), Cancelled);
}

TEST(SignedDistance, is_the_oracles_distance_and_sign_by_every_fill) {
  const Scene scene = wavy_sphere(2);
  VoxelizeOptions options = band_options(2.5, 24);
  options.sign = Sign::kParity;
  options.channels = ChannelSet{.distance = true};
  for (const Fill fill : {Fill::kBand, Fill::kSurface, Fill::kSolid, Fill::kShell}) {
    options.fill = fill;
    const Grid grid = voxelized(scene, options);
    const OracleGrid place = oracle_grid(grid);
    const auto snapped = reference::snap_triangles(triangles_of(scene), place);
    const Occupancy inside = reference::parity_cells(snapped, place, 2);
    const auto all = distances_of(grid);
    EXPECT_GT(all.size(), 1000u);
    for (const auto& [cell, got] : all) {
      const long double steps = reference::surface_distance(snapped, cell) / 4;
      const auto at =
          static_cast<size_t>(cell[0] + place.dims[0] * (cell[1] + place.dims[1] * cell[2]));
      ASSERT_EQ(got < 0, inside[at] != 0) << static_cast<int>(fill);
      if (steps < 1) continue;
      ASSERT_LE(std::abs(std::abs(got) - steps), 0.5L + 1e-6L);
    }
  }
}

TEST(WorldDistance, is_the_oracles_in_voxels_that_are_no_cubes_and_the_voxels_are_the_same) {
  const Scene scene = wavy_sphere(2);
  VoxelizeOptions options = band_options(2, 24);
  options.placement.size.reset();
  options.placement.voxel_size = {0.1, 0.3, 0.12};
  options.sign = Sign::kParity;
  options.channels = ChannelSet{.distance = true};
  for (const Fill fill : {Fill::kBand, Fill::kSurface, Fill::kSolid, Fill::kShell}) {
    options.fill = fill;
    options.distance = DistanceUnit::kVoxels;
    const Grid in_voxels = voxelized(scene, options);
    options.distance = DistanceUnit::kWorld;
    const Grid grid = voxelized(scene, options);
    EXPECT_EQ(differences(cells_of(grid), cells_of(in_voxels)), 0u);
    EXPECT_FALSE(grid.tiles == in_voxels.tiles);
    const OracleGrid place = oracle_grid(grid);
    const auto snapped = reference::snap_triangles(triangles_of(scene), place);
    const Occupancy inside = reference::parity_cells(snapped, place, 2);
    const auto all = distances_of(grid);
    EXPECT_GT(all.size(), 300u);
    for (const auto& [cell, got] : all) {
      // In world units, then in 1/128 of the shortest edge.
      const long double world = reference::surface_distance(snapped, cell, {0.1, 0.3, 0.12}) / 512;
      const long double steps = world / 0.1L * 128;
      const auto at =
          static_cast<size_t>(cell[0] + place.dims[0] * (cell[1] + place.dims[1] * cell[2]));
      ASSERT_EQ(got < 0, inside[at] != 0) << static_cast<int>(fill);
      if (steps < 1) continue;
      ASSERT_LE(std::abs(std::abs(got) - steps), 0.5L + 1e-6L);
    }
  }
}

TEST(WorldDistance, of_cubes_is_stored_as_that_in_voxels) {
  const Scene scene = wavy_sphere(2);
  for (const Fill fill : {Fill::kBand, Fill::kSolid}) {
    VoxelizeOptions options = band_options(3, 40);
    options.fill = fill;
    options.channels = ChannelSet{.distance = true};
    const Grid in_voxels = voxelized(scene, options);
    options.distance = DistanceUnit::kWorld;
    EXPECT_TRUE(voxelized(scene, options).tiles == in_voxels.tiles);
  }
}

TEST(WorldDistance, edges_that_differ_too_much_are_refused) {
  const Scene scene = wavy_sphere(1);
  VoxelizeOptions options = band_options(1, 24);
  options.placement.size.reset();
  options.placement.voxel_size = {0.125, 32.0, 0.25};
  options.distance = DistanceUnit::kWorld;
  Voxelizer voxelizer(nullptr, 1);
  EXPECT_TRUE(voxelizer.voxelize(scene, options, {}, nullptr).ok());
  options.placement.voxel_size = {0.125, 32.5, 0.25};
  const auto refused = voxelizer.voxelize(scene, options, {}, nullptr);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidOption);
  EXPECT_EQ(refused.error().message(),
            "distance=world: the longest edge of a voxel, divided by the shortest: expected at "
            "most 256, got 260");
  EXPECT_FALSE(voxelizer.estimate(scene, options).ok());
  options.distance = DistanceUnit::kVoxels;
  EXPECT_TRUE(voxelizer.voxelize(scene, options, {}, nullptr).ok());
}

TEST(SignedDistance, no_voxel_and_no_other_attribute_changes_for_it) {
  const Scene scene = wavy_sphere(2);
  for (const Fill fill : {Fill::kSurface, Fill::kSolid, Fill::kShell, Fill::kBand}) {
    VoxelizeOptions options = band_options(3, 60);
    options.fill = fill;
    options.color = ColorMode::kAxis;
    options.channels = ChannelSet{.color = true};
    Grid plain = voxelized(scene, options);
    options.channels->distance = true;
    Grid measured = voxelized(scene, options, nullptr, 3);
    EXPECT_TRUE(measured.channels.distance);
    EXPECT_FALSE(plain.channels.distance);
    for (SparseTile& tile : measured.tiles) tile.distance.clear();
    // (What is full of a band without distances is full nodes.)
    EXPECT_EQ(differences(cells_of(plain), cells_of(measured)), 0u);
    if (fill == Fill::kBand) continue;
    EXPECT_TRUE(plain.tiles == measured.tiles) << static_cast<int>(fill);
  }
}

TEST(SignedDistance, surface_voxels_of_a_solid_have_one_where_it_has_no_other_attribute) {
  VoxelizeOptions options = band_options(1, 64);
  options.fill = Fill::kSurface;
  const Occupancy surface = cells_of(voxelized(wavy_sphere(2), options));
  options.fill = Fill::kSolid;
  options.channels = ChannelSet{.distance = true};
  const Grid solid = voxelized(wavy_sphere(2), options);
  const auto all = distances_of(solid);
  EXPECT_LT(all.size(), solid.voxel_count());  // full nodes have none
  for (int z = 0; z < solid.spec.dims.z; ++z) {
    for (int y = 0; y < solid.spec.dims.y; ++y) {
      for (int x = 0; x < solid.spec.dims.x; ++x) {
        const auto at = static_cast<size_t>(x + solid.spec.dims.x * (y + solid.spec.dims.y * z));
        ASSERT_TRUE(surface[at] == 0 || all.contains({x, y, z}));
      }
    }
  }
}

TEST(SignedDistance, zero_lies_on_a_sphere_within_a_hundredth_of_a_voxel) {
  // 81,920 triangles, sides below a voxel: 0.002 voxels from the sphere, as is what snapping moves;
  // 1/256 comes of rounding, and 0.003 of interpolating along edges of cells.
  constexpr double kRadius = 40;
  Scene sphere = moved(wavy_sphere(6), [](const glm::dvec3& p) {
    return glm::normalize(p) * kRadius + glm::dvec3(50.3, 49.6, 50.45);
  });
  VoxelizeOptions options = band_options(2, 0);
  solid_test::set_bounds(options, glm::dvec3(0), glm::dvec3(100));
  options.placement.padding = 0;
  const auto all = distances_of(voxelized(sphere, options));
  size_t crossings = 0;
  for (const auto& [cell, a] : all) {
    for (size_t axis = 0; axis < 3; ++axis) {
      std::array<int, 3> next = cell;
      ++next[axis];
      const auto b = all.find(next);
      if (b == all.end() || (a < 0) == (b->second < 0)) continue;
      glm::dvec3 p(cell[0] + 0.5, cell[1] + 0.5, cell[2] + 0.5);
      p[static_cast<int>(axis)] += static_cast<double>(a) / (a - b->second);
      ASSERT_NEAR(glm::length(p - glm::dvec3(50.3, 49.6, 50.45)), kRadius, 0.01);
      ++crossings;
    }
  }
  EXPECT_GT(crossings, 20000u);
}

}  // namespace
}  // namespace voxeld
