// Fills: the same bytes from all pipelines. tests/unit/voxel_solid compares those of the CPU with
// the oracle, tests/gpu/oracle those of the devices.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/bench/waves.h"
#include "tests/gpu/voxel/pipelines.h"
#include "tests/unit/base/points_passed.h"

namespace voxeld::pipelines {
namespace {

struct NamedSign {
  Sign sign;
  const char* name;
};
constexpr std::array<NamedSign, 6> kSigns = {{{Sign::kParity, "parity"},
                                              {Sign::kNonzero, "nonzero"},
                                              {Sign::kMajority, "majority"},
                                              {Sign::kFlood, "flood"},
                                              {Sign::kWinding, "winding"},
                                              {Sign::kAuto, "auto"}}};

VoxelizeOptions solid(VoxelizeOptions options, Sign sign) {
  options.fill = Fill::kSolid;
  options.sign = sign;
  options.rule = Rule::kNone;
  options.color = ColorMode::kNone;
  return options;
}

VoxelizeOptions of_size(int size) {
  VoxelizeOptions options;
  options.placement.size = size;
  return options;
}

std::vector<PipelineChoice> devices() {
  return {PipelineChoice::kCompute, PipelineChoice::kRaster};
}

const char* name_of(PipelineChoice pipeline) {
  return pipeline == PipelineChoice::kRaster ? " raster" : " compute";
}

void sort_tiles(Grid& grid) {
  std::ranges::sort(grid.tiles, {}, [](const SparseTile& tile) { return tile.coord; });
}

// Expects the CPU's bytes and its report; gives the number of voxels by sign.
std::vector<size_t> expect_equal(const Scene& scene, const VoxelizeOptions& placed,
                                 const std::string& what) {
  std::vector<size_t> counts;
  for (const auto& [sign, sign_name] : kSigns) {
    const VoxelizeOptions options = solid(placed, sign);
    VoxelizeStats cpu;
    Grid expected = voxelize(scene, options, PipelineChoice::kCpu, &cpu);
    sort_tiles(expected);
    counts.push_back(voxel_count(expected));
    for (const PipelineChoice pipeline : devices()) {
      const std::string name = what + " " + sign_name + name_of(pipeline);
      VoxelizeStats stats;
      Grid grid = voxelize(scene, options, pipeline, &stats);
      sort_tiles(grid);
      EXPECT_EQ(voxel_count(grid), counts.back()) << name;
      EXPECT_TRUE(grid.tiles == expected.tiles) << name;
      EXPECT_EQ(stats.fill->sign, cpu.fill->sign) << name;
      EXPECT_EQ(stats.fill->reason, cpu.fill->reason) << name;
      EXPECT_EQ(stats.fill->ambiguous_fraction, cpu.fill->ambiguous_fraction) << name;
    }
  }
  return counts;
}

Scene without(Scene scene, double z_max) {
  for (MeshPart& part : scene.parts) {
    std::vector<uint32_t> indices;
    for (size_t i = 0; i + 2 < part.indices.size(); i += 3) {
      const uint32_t* corner = &part.indices[i];
      const double z = (part.positions[corner[0]].z + part.positions[corner[1]].z +
                        part.positions[corner[2]].z) /
                       3;
      if (z < z_max) indices.insert(indices.end(), corner, corner + 3);
    }
    part.indices = std::move(indices);
  }
  return scene;
}

Scene moved(Scene scene, const glm::dvec3& scale, const glm::dvec3& shift) {
  for (MeshPart& part : scene.parts) {
    for (glm::dvec3& p : part.positions) p = p * scale + shift;
  }
  return scene;
}

Scene joined(Scene a, const Scene& b) {
  a.parts.insert(a.parts.end(), b.parts.begin(), b.parts.end());
  return a;
}

TEST(Solid, a_closed_mesh_has_the_same_inside_on_every_pipeline) {
  for (const int size : {37, 90}) {
    const auto counts = expect_equal(wavy_sphere(3), of_size(size), std::to_string(size));
    EXPECT_GT(counts.front(), 5000u);
  }
}

TEST(Solid, an_open_mesh_has_the_same_inside_on_every_pipeline) {
  for (const double cut : {0.8, 0.3, -0.2}) {
    const Scene open = without(wavy_sphere(3), cut);
    const auto counts = expect_equal(open, of_size(70), "cut " + std::to_string(cut));
    EXPECT_GT(counts.back(), 1000u);
  }
}

TEST(Solid, parts_that_overlap_and_are_inside_out_have_the_same_inside_on_every_pipeline) {
  const Scene sphere = wavy_sphere(2);
  const Scene all = joined(joined(sphere, moved(sphere, glm::dvec3(1), {0.7, 0, 0})),
                           moved(sphere, {-0.4, 0.4, 0.4}, {0, 0, 0}));
  expect_equal(all, of_size(61), "closed");
  expect_equal(without(all, 0.5), of_size(61), "open");
}

TEST(Solid, the_same_shell_many_times_over_is_counted_exactly) {
  const Scene sphere = wavy_sphere(1);
  Scene many;
  for (int i = 0; i < 300; ++i) many = joined(std::move(many), sphere);
  const auto counts = expect_equal(many, of_size(24), "300 shells");
  EXPECT_EQ(counts[0], 0u);     // an even number of crossings
  EXPECT_GT(counts[1], 1000u);  // but one sum of signs
}

TEST(Solid, triangles_that_close_nothing_give_the_same_on_every_pipeline) {
  for (uint64_t seed = 1; seed < 4; ++seed) {
    const Scene scene = soup(seed, {.count = 60, .extent = 40, .size_max = 30});
    expect_equal(scene, unit_cells({40, 37, 43}), "soup " + std::to_string(seed));
  }
}

TEST(Solid, sides_and_corners_on_centres_of_columns_are_decided_alike) {
  Scene coarse = soup(9, {.count = 80, .extent = 12, .size_max = 12});
  for (glm::dvec3& p : coarse.parts[0].positions) p = glm::floor(p) + 0.5;
  expect_equal(coarse, unit_cells({13, 13, 13}), "centres");
}

TEST(Solid, grids_of_several_tiles_that_are_no_multiples_of_a_tile) {
  for (const std::array<int, 3> dims :
       {std::array{530, 9, 70}, {40, 300, 33}, {33, 40, 520}, {270, 260, 300}}) {
    const glm::dvec3 size(dims[0], dims[1], dims[2]);
    MeshPart part;
    add_box(part, size * 0.2, size * 0.8);
    Scene scene = soup(3, {.count = 12, .extent = 300, .size_max = 200});
    scene.parts.push_back(std::move(part));
    expect_equal(scene, unit_cells(dims), std::to_string(dims[0]) + " cells");
  }
}

TEST(Solid, bounds_that_cut_the_mesh_leave_out_nothing_below) {
  const Scene sphere = moved(wavy_sphere(3), glm::dvec3(60), {30, 40, 20});
  const auto counts = expect_equal(sphere, unit_cells({50, 70, 45}), "cut");
  EXPECT_GT(counts.front(), 10'000u);
  expect_equal(without(sphere, 40), unit_cells({50, 70, 45}), "cut and open");
}

// Corners beyond 2^19 sub-voxels from the tile, up to 2^30.
TEST(Solid, triangles_that_reach_far_beside_the_grid) {
  for (const double reach : {1000.0, 2047.5, 2052.0, 3e4, 1e9}) {
    MeshPart part;
    add_box(part, glm::dvec3(-reach, -reach, 10.3), {reach, reach * 0.7, 21.7});
    add_triangle(part, {-reach, 5, 3}, {reach, 9, 30}, {20, reach, 11});
    add_triangle(part, {3, -reach, -reach}, {31, reach, 7}, {20, 3, reach});
    expect_equal(scene_of(std::move(part)), unit_cells({40, 37, 43}),
                 "reach " + std::to_string(reach));
  }
}

TEST(Solid, tiles_that_nothing_touches_are_full_or_empty_nodes) {
  MeshPart part;
  add_box(part, {-5, -5, -5}, {520, 300, 700});
  const Scene scene = scene_of(std::move(part));
  expect_equal(scene, unit_cells({300, 256, 768}), "box");
}

TEST(Solid, devices_name_their_passes_and_keep_their_memory) {
  const Scene open = without(wavy_sphere(3), 0.3);
  for (const PipelineChoice pipeline : devices()) {
    for (const auto& [sign, name] : kSigns) {
      VoxelizeOptions options = solid(of_size(70), sign);
      options.pipeline = pipeline;
      const auto estimate = voxelizer().estimate(open, options);
      ASSERT_TRUE(estimate.ok()) << estimate.error().message();
      VoxelizeStats stats;
      voxelize(open, options, pipeline, &stats);
      EXPECT_GT(stats.device_bytes_peak, 0) << name;
      EXPECT_LE(stats.device_bytes_peak, estimate->device_bytes) << name;
      const bool named = std::ranges::any_of(stats.passes, [](const auto& pass) {
        return pass.first == "inside_sweep" || pass.first == "inside_flood";
      });
      EXPECT_TRUE(named) << name;
    }
  }
}

// A corridor that turns round so often.
Scene maze(int turns) {
  MeshPart part;
  const double size = 2 * turns + 1;
  for (int wall = 0; wall <= turns; ++wall) {
    // Open at one end, and by turns at the other.
    const bool first = wall % 2 == 0, outer = wall == 0 || wall == turns;
    const double y = 2 * wall + 0.5, low = first || outer ? 0.5 : 2.5;
    const double high = first && !outer ? size - 2.5 : size - 0.5;
    add_quad(part, {glm::dvec3(low, y, 0), {high, y, 0}, {high, y, 5}, {low, y, 5}});
  }
  for (const double x : {0.5, size - 0.5}) {
    add_quad(part, {glm::dvec3(x, 3.2, 0), {x, size - 0.5, 0}, {x, size - 0.5, 5}, {x, 3.2, 5}});
  }
  for (const double z : {0.5, 4.5}) {
    add_quad(part, {glm::dvec3(0, 0, z), {size, 0, z}, {size, size, z}, {0, size, z}});
  }
  return scene_of(std::move(part));
}

TEST(Solid, a_maze_is_flooded_to_its_end_wherever_that_is_done) {
  for (const int turns : {5, 150}) {
    const int side = 2 * turns + 1;
    const VoxelizeOptions options = solid(unit_cells({side, side, 5}), Sign::kFlood);
    const Grid expected = voxelize(maze(turns), options, PipelineChoice::kCpu);
    VoxelizeStats stats;
    const Grid grid = voxelize(maze(turns), options, PipelineChoice::kCompute, &stats);
    EXPECT_TRUE(grid.tiles == expected.tiles) << turns;
    const bool ended = std::ranges::any_of(
        stats.passes, [](const auto& pass) { return pass.first == "inside_read"; });
    EXPECT_EQ(ended, turns < 64) << turns;
    // Nothing of the corridor is inside.
    EXPECT_LT(voxel_count(grid), static_cast<size_t>(side) * side * 5 * 9 / 10) << turns;
  }
}

// Bits of all bricks are made before and after the passes: of 32,768 in a tile.
TEST(Solid, a_flood_has_a_cancellation_point_for_each_brick_that_it_reads_or_makes) {
  SparseTile touched;
  touched.full.push_back({0, 2});  // 64 bricks
  std::vector<SparseTile> tiles;
  VoxelizeStats stats;
  GlFlood flood(gpu::test_context(), shared_shaders());
  const int points = test::points_passed([&] {
    const auto done = flood.run({&touched, 1}, {64, 64, 64}, {}, 0, tiles, stats);
    EXPECT_TRUE(done.ok() && *done);
  });
  EXPECT_GE(points, 64 + 64);  // bricks that are touched, and rows of bricks
}

TEST(Solid, surfaces_with_colours_and_shells_are_joined_alike) {
  const Scene scene = soup(5, {.count = 300, .extent = 64, .size_max = 60, .colors = true});
  for (const Fill fill : {Fill::kSolid, Fill::kShell}) {
    VoxelizeOptions options = unit_cells({64, 64, 64});
    options.fill = fill;
    options.sign = Sign::kMajority;
    options.thickness = 3;
    EXPECT_GT(voxel_count(voxelize_all(scene, options)), 10'000u);
  }
}

}  // namespace
}  // namespace voxeld::pipelines
