// Properties of fills beyond the oracle: bounds, order, threads, attributes, progress, reports.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/bench/waves.h"
#include "tests/unit/voxel_solid/solid_scenes.h"

namespace voxeld {
namespace {

using namespace solid_test;

constexpr Sign kSigns[] = {Sign::kAuto,     Sign::kParity, Sign::kNonzero,
                           Sign::kMajority, Sign::kFlood,  Sign::kWinding};

// A sphere of radius 40 with holes, in the middle of a box of 100.
Scene open_sphere() {
  const Scene sphere =
      without(wavy_sphere(3), [](const glm::dvec3& c) { return c.y > 0.75 || c.x + c.z > 1.2; });
  return moved(sphere, [](const glm::dvec3& p) { return 30.0 * p + 50.0; });
}

VoxelizeOptions in_bounds(Sign sign, const glm::dvec3& min, const glm::dvec3& max) {
  VoxelizeOptions options = solid(sign);
  set_bounds(options, min, max);
  return options;
}

TEST(Fill, a_box_that_cuts_the_mesh_equals_that_part_of_the_whole_grid) {
  const Scene scene = open_sphere();
  const glm::ivec3 low(41, 33, 52), high(83, 66, 71);
  for (const Sign sign : kSigns) {
    // To a flood, and to the regions of auto, a mesh that leaves the box is open: it enters by the
    // cut.
    if (sign == Sign::kFlood || sign == Sign::kAuto) continue;
    const Occupancy whole =
        cells_of(voxelized(scene, in_bounds(sign, glm::dvec3(0), glm::dvec3(100))));
    const Occupancy part =
        cells_of(voxelized(scene, in_bounds(sign, glm::dvec3(low), glm::dvec3(high))));
    Occupancy crop;
    for (int z = low.z; z < high.z; ++z) {
      for (int y = low.y; y < high.y; ++y) {
        for (int x = low.x; x < high.x; ++x) {
          crop.push_back(whole[static_cast<size_t>(x + 100 * (y + 100 * z))]);
        }
      }
    }
    EXPECT_GT(reference::count(part), 1000u);
    EXPECT_EQ(differences(part, crop), 0u) << static_cast<int>(sign);
  }
}

TEST(Fill, geometry_far_outside_the_box_counts) {
  // The box stands in a block whose walls are up to ten million cells away.
  const Scene block = box(glm::dvec3(-1e7, -3e6, -20), glm::dvec3(1e7, 5, 9e6));
  for (const Sign sign : {Sign::kParity, Sign::kNonzero, Sign::kMajority, Sign::kWinding}) {
    const Grid grid = voxelized(block, in_bounds(sign, glm::dvec3(0), glm::dvec3(8)));
    EXPECT_EQ(grid.voxel_count(), 8u * 5 * 8) << static_cast<int>(sign);
  }
}

TEST(Fill, whole_cells_of_translation_shift_the_grid) {
  const Scene scene = open_sphere();
  const Scene shifted = moved(scene, [](const glm::dvec3& p) { return p + glm::dvec3(7, -3, 12); });
  for (const Sign sign : kSigns) {
    const Grid here = voxelized(scene, in_bounds(sign, glm::dvec3(0), glm::dvec3(100)));
    const Grid there =
        voxelized(shifted, in_bounds(sign, glm::dvec3(7, -3, 12), glm::dvec3(107, 97, 112)));
    EXPECT_TRUE(here.tiles == there.tiles) << static_cast<int>(sign);
  }
}

TEST(Fill, turning_the_axes_turns_the_majority) {
  const Scene scene = open_sphere();
  const Scene turned = moved(scene, [](const glm::dvec3& p) { return glm::dvec3(p.y, p.z, p.x); });
  const VoxelizeOptions options = in_bounds(Sign::kMajority, glm::dvec3(0), glm::dvec3(100));
  const Occupancy here = cells_of(voxelized(scene, options));
  const Occupancy there = cells_of(voxelized(turned, options));
  size_t wrong = 0;
  for (size_t i = 0; i < here.size(); ++i) {
    const size_t x = i % 100, y = i / 100 % 100, z = i / 10000;
    wrong += here[i] != there[y + 100 * (z + 100 * x)];
  }
  EXPECT_EQ(wrong, 0u);
}

TEST(Fill, neither_order_nor_threads_change_a_byte) {
  const Scene scene = open_sphere();
  auto triangles = triangles_of(scene);
  std::mt19937 random(5);
  std::shuffle(triangles.begin(), triangles.end(), random);
  for (auto& triangle : triangles) {
    std::rotate(triangle.begin(), triangle.begin() + random() % 3, triangle.end());
  }
  const Scene shuffled = scene_of(triangles);
  for (const Sign sign : kSigns) {
    for (const int size : {60, 300}) {
      if (size == 300 && sign != Sign::kAuto && sign != Sign::kNonzero) continue;
      VoxelizeOptions options = solid(sign);
      options.placement.size = size;
      const Grid one = voxelized(scene, options, nullptr, 1);
      const Grid many = voxelized(shuffled, options, nullptr, 7);
      EXPECT_GT(one.voxel_count(), 1000u);
      EXPECT_TRUE(one.tiles == many.tiles) << static_cast<int>(sign) << " at " << size;
    }
  }
}

TEST(Fill, orientation_matters_to_nonzero_and_winding_alone) {
  const Scene ball = box(glm::dvec3(0), glm::dvec3(20)), inner = box(glm::dvec3(5), glm::dvec3(15));
  const Scene turned = moved(inner, [](const glm::dvec3& p) {
    return glm::dvec3(20.0 - p.x, p.y, p.z);  // mirrored: wound inwards
  });
  const auto count = [](const Scene& scene, Sign sign) {
    return voxelized(scene, in_bounds(sign, glm::dvec3(0), glm::dvec3(20))).voxel_count();
  };
  for (const Sign sign : {Sign::kNonzero, Sign::kWinding, Sign::kAuto}) {
    EXPECT_EQ(count(joined(ball, inner), sign), 8000u);
    EXPECT_EQ(count(joined(ball, turned), sign), 7000u);
  }
  for (const Sign sign : {Sign::kParity, Sign::kMajority}) {
    EXPECT_EQ(count(joined(ball, inner), sign), 7000u);
    EXPECT_EQ(count(joined(ball, turned), sign), 7000u);
  }
}

TEST(Fill, a_mirroring_transform_does_not_turn_the_inside_out) {
  VoxelizeOptions options = solid(Sign::kWinding);
  options.placement.size = 30;
  options.placement.transform = {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  EXPECT_EQ(voxelized(box(glm::dvec3(0), glm::dvec3(3)), options).voxel_count(), 27000u);
}

TEST(Fill, tiles_inside_cost_one_node) {
  for (const Sign sign :
       {Sign::kParity, Sign::kNonzero, Sign::kMajority, Sign::kWinding, Sign::kFlood}) {
    VoxelizeOptions options = solid(sign);
    set_bounds(options, glm::dvec3(0), glm::dvec3(768, 300, 300));
    const Grid grid = voxelized(box(glm::dvec3(3), glm::dvec3(765, 300, 300)), options);
    ASSERT_EQ(grid.tiles.size(), 12u);
    // The flood leaves the cells of the faces at 765, too, whose centres are outside.
    EXPECT_EQ(grid.voxel_count(), (sign == Sign::kFlood ? 763u : 762u) * 297 * 297)
        << static_cast<int>(sign);
    VoxelizeOptions all = options;
    set_bounds(all, glm::dvec3(0), glm::dvec3(768));
    const Grid full = voxelized(box(glm::dvec3(-5), glm::dvec3(900)), all);
    if (sign == Sign::kFlood) continue;
    ASSERT_EQ(full.tiles.size(), 27u);
    for (const SparseTile& tile : full.tiles) {
      EXPECT_TRUE(tile.masks.empty());
      ASSERT_EQ(tile.full.size(), 1u);
      EXPECT_EQ(tile.full[0].level, kTileLevels);
    }
  }
}

TEST(Fill, solids_are_surface_and_inside_in_canonical_form) {
  const Scene scene = open_sphere();
  for (const Sign sign : kSigns) {
    VoxelizeOptions options = in_bounds(sign, glm::dvec3(0), glm::dvec3(100));
    Occupancy expected = cells_of(voxelized(scene, options));
    options.rule = Rule::kTouch;
    const Grid grid = voxelized(scene, options);
    options.fill = Fill::kSurface;
    const Occupancy surface = cells_of(voxelized(scene, options));
    for (size_t i = 0; i < expected.size(); ++i) expected[i] |= surface[i];
    EXPECT_EQ(differences(cells_of(grid), expected), 0u) << static_cast<int>(sign);
    for (SparseTile tile : grid.tiles) {
      const SparseTile before = tile;
      canonicalize(tile);
      EXPECT_TRUE(tile == before);
    }
  }
}

TEST(Fill, interior_voxels_have_no_attributes) {
  const Scene scene = box(glm::dvec3(1.5), glm::dvec3(62.5));
  VoxelizeOptions options = in_bounds(Sign::kAuto, glm::dvec3(0), glm::dvec3(64));
  options.rule = Rule::kTouch;
  options.color = ColorMode::kAxis;
  options.channels = ChannelSet{.color = true, .normal = true};
  const Grid solid_grid = voxelized(scene, options);
  options.fill = Fill::kSurface;
  const Grid surface = voxelized(scene, options);
  EXPECT_EQ(solid_grid.voxel_count(), 62u * 62 * 62);
  ASSERT_EQ(solid_grid.tiles.size(), 1u);
  const SparseTile& tile = solid_grid.tiles[0];
  EXPECT_FALSE(tile.full.empty());
  ASSERT_EQ(tile.color.size(), 4 * tile.attribute_count());
  ASSERT_EQ(tile.normal.size(), 3 * tile.attribute_count());
  // Without the voxels whose attributes are 0, the surface is left as it is.
  std::vector<uint8_t> color;
  std::vector<int8_t> normal;
  for (size_t i = 0; i < tile.attribute_count(); ++i) {
    if (tile.color[4 * i + 3] == 0) continue;
    for (size_t c = 0; c < 4; ++c) color.push_back(tile.color[4 * i + c]);
    for (size_t c = 0; c < 3; ++c) normal.push_back(tile.normal[3 * i + c]);
  }
  EXPECT_TRUE(color == surface.tiles[0].color);
  EXPECT_TRUE(normal == surface.tiles[0].normal);
}

TEST(Fill, auto_says_which_sign_it_took_and_why) {
  VoxelizeStats stats;
  VoxelizeOptions options = solid(Sign::kAuto);
  options.placement.size = 40;
  voxelized(box(glm::dvec3(0), glm::dvec3(1)), options, &stats);
  ASSERT_TRUE(stats.fill);
  EXPECT_EQ(stats.fill->sign, Sign::kNonzero);
  EXPECT_EQ(stats.fill->reason, "nonzero: the mesh is closed and consistently oriented");
  EXPECT_EQ(stats.fill->boundary_edges, 0);
  EXPECT_EQ(stats.fill->ambiguous_fraction, 0.0);
  stats = {};
  voxelized(open_sphere(), options, &stats);
  ASSERT_TRUE(stats.fill);
  EXPECT_EQ(stats.fill->sign, Sign::kMajority);
  EXPECT_GT(*stats.fill->boundary_edges, 10);
  EXPECT_GT(*stats.fill->ambiguous_fraction, 0.01);
  EXPECT_LT(*stats.fill->ambiguous_fraction, 1.0);
  EXPECT_NE(stats.fill->reason.find("does not close at"), std::string::npos);
}

TEST(Fill, the_axes_agree_on_closed_meshes) {
  VoxelizeStats stats;
  VoxelizeOptions options = solid(Sign::kMajority);
  options.placement.size = 70;
  options.rule = Rule::kTouch;
  voxelized(wavy_sphere(3), options, &stats);
  EXPECT_EQ(stats.fill->ambiguous_fraction, 0.0);
}

// One face of three pairs is missing: x and y see a tube, and z sees no way in.
TEST(Fill, ambiguous_cells_are_those_on_which_axes_disagree) {
  const Scene open =
      without(box(glm::dvec3(10), glm::dvec3(20)), [](const glm::dvec3& c) { return c.z == 20.0; });
  VoxelizeStats stats;
  const Grid grid =
      voxelized(open, in_bounds(Sign::kMajority, glm::dvec3(0), glm::dvec3(30)), &stats);
  EXPECT_EQ(grid.voxel_count(), 1000u);
  // Along z everything above the bottom, 10 x 10 x 20, is inside; along x and y the upper half of
  // that is not.
  EXPECT_EQ(stats.fill->ambiguous_fraction, 0.5);
}

TEST(Fill, can_be_cancelled_in_its_second_half) {
  const Scene scene = open_sphere();
  VoxelizeOptions options = solid(Sign::kAuto);
  options.placement.size = 700;
  Voxelizer voxelizer(nullptr, 1);
  int64_t last = -1;
  bool is_prepared = false;
  const auto grid = voxelizer.voxelize(
      scene, options,
      [&](int64_t done, int64_t total) {
        EXPECT_GE(done, last);
        is_prepared |= total != 0;
        EXPECT_EQ(total, is_prepared ? 9 : 0);
        last = done;
        return done < 3;
      },
      nullptr);
  ASSERT_FALSE(grid.ok());
  EXPECT_TRUE(is_prepared);
  EXPECT_EQ(grid.error().code, ErrorCode::kCancelled);
  EXPECT_GE(last, 3);
  EXPECT_LT(last, 9);
}

TEST(Fill, can_be_cancelled_while_it_is_prepared) {
  const Scene scene = open_sphere();
  Voxelizer voxelizer(nullptr, 1);
  for (int wanted = 1;; ++wanted) {
    int calls = 0;
    bool is_prepared = false;
    const auto grid = voxelizer.voxelize(
        scene, solid(Sign::kAuto),
        [&](int64_t, int64_t total) {
          is_prepared |= total != 0;
          return ++calls < wanted;
        },
        nullptr);
    if (is_prepared) {
      EXPECT_GT(wanted, 3) << "it can be stopped between its steps";
      break;
    }
    ASSERT_FALSE(grid.ok());
    EXPECT_EQ(grid.error().code, ErrorCode::kCancelled);
    EXPECT_EQ(calls, wanted) << "nothing is done after that";
  }
}

TEST(Fill, estimates_cover_the_needs_of_a_fill) {
  Voxelizer voxelizer(nullptr, 2);
  VoxelizeOptions options = solid(Sign::kParity);
  options.rule = Rule::kTouch;
  options.placement.size = 500;
  const Scene scene = wavy_sphere(4);
  options.fill = Fill::kSurface;
  const int64_t surface = voxelizer.estimate(scene, options)->host_bytes;
  options.fill = Fill::kSolid;
  const int64_t parity = voxelizer.estimate(scene, options)->host_bytes;
  options.sign = Sign::kMajority;
  const int64_t majority = voxelizer.estimate(scene, options)->host_bytes;
  EXPECT_LT(surface, parity);
  EXPECT_LT(parity, majority);
  int64_t bytes = 0;
  for (const SparseTile& tile : voxelized(scene, options).tiles) {
    bytes += static_cast<int64_t>(tile.masks.size() * 68 + tile.full.size() * sizeof(FullNode));
  }
  EXPECT_LT(bytes, parity - surface);
  voxelizer.set_host_bytes_max((surface + parity) / 2);
  options.sign = Sign::kParity;
  const auto refused = voxelizer.voxelize(scene, options, {}, nullptr);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kGridTooLarge);
}

// Triangles that share no edges.
Scene separate_triangles(int side) {
  Scene scene;
  MeshPart& part = scene.parts.emplace_back();
  for (int i = 0; i < side * side * side; ++i) {
    const glm::dvec3 p(i % side, i / side % side, i / side / side);
    for (const glm::dvec3& corner : {p, p + glm::dvec3(0.3, 0, 0), p + glm::dvec3(0, 0.3, 0)}) {
      part.indices.push_back(static_cast<uint32_t>(part.positions.size()));
      part.positions.push_back(corner);
    }
  }
  return scene;
}

TEST(Fill, winding_numbers_count_as_memory_and_are_refused_once_the_open_edges_are_known) {
  const Scene scene = separate_triangles(35);
  const auto count = static_cast<int64_t>(scene.triangle_count());
  Voxelizer voxelizer(nullptr, 2);
  VoxelizeOptions options = solid(Sign::kParity);
  options.placement.size = 16;
  const int64_t parity = voxelizer.estimate(scene, options)->host_bytes;
  options.sign = Sign::kWinding;
  const int64_t winding = voxelizer.estimate(scene, options)->host_bytes;
  EXPECT_GT(winding, parity + 300 * count);
  voxelizer.set_host_bytes_max(winding);  // there are three open edges for each triangle
  const auto refused = voxelizer.voxelize(scene, options, {}, nullptr);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kGridTooLarge);
}

TEST(Fill, the_daemon_keeps_its_voxelizer_from_one_fill_to_the_next) {
  const Scene open = open_sphere(), closed = wavy_sphere(3);
  Voxelizer voxelizer(nullptr, 2);
  for (const Sign sign : {Sign::kAuto, Sign::kParity, Sign::kWinding}) {
    VoxelizeOptions options = solid(sign);
    for (const int size : {270, 50}) {
      if (size == 270 && sign != Sign::kAuto) continue;  // kAuto takes each pass
      options.placement.size = size;
      for (const Scene* scene : {&open, &closed}) {
        const auto grid = voxelizer.voxelize(*scene, options, {}, nullptr);
        ASSERT_TRUE(grid.ok());
        EXPECT_TRUE(grid->tiles == voxelized(*scene, options).tiles);
      }
    }
  }
}

}  // namespace
}  // namespace voxeld
