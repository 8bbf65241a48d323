// The ray march against a DDA in double precision.
#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <random>

#include "server/render/camera.h"
#include "tests/gpu/render/hits_check.h"
#include "tests/gpu/render/test_grids.h"

namespace voxeld {
namespace {

TEST(RayMarch, hits_the_cells_of_a_dda_in_double_precision_from_random_cameras) {
  constexpr uint32_t kSeed = 20161;
  std::mt19937 random(kSeed);
  std::uniform_real_distribution<double> unit;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  const GridSpec specs[] = {spec_of({37, 50, 64}, {1, 1, 1}), spec_of({64, 9, 21}, {0.5, 2, 1}),
                            spec_of({1, 130, 3}, {1, 0.01, 0.5}), spec_of({8, 8, 8}, {3, 3, 3})};
  int hits = 0;
  for (const GridSpec& spec : specs) {
    const Grid grid = noise_grid(spec, 0.02, static_cast<uint32_t>(random()));
    ASSERT_TRUE(hits_renderer().set_grid(grid).ok());
    for (int i = 0; i < 6; ++i) {
      RenderOptions options = options_of(60, 45, 360 * unit(random), 180 * unit(random) - 90);
      options.projection = i % 2 == 0 ? Projection::kPerspective : Projection::kOrthographic;
      options.zoom = 0.7 + unit(random);
      SCOPED_TRACE("azimuth " + std::to_string(options.azimuth_deg) + " elevation " +
                   std::to_string(options.elevation_deg));
      hits += expect_same_hits(options, grid);
    }
  }
  EXPECT_GT(hits, 10000);
}

TEST(RayMarch, rays_parallel_to_an_axis_hit_the_same) {
  const Grid grid = noise_grid(spec_of({40, 33, 20}, {1, 1, 2}), 0.01, 7);
  ASSERT_TRUE(hits_renderer().set_grid(grid).ok());
  for (const auto& [azimuth, elevation] :
       {std::pair{0.0, 0.0}, {90.0, 0.0}, {180.0, 0.0}, {270.0, 0.0}, {0.0, 90.0}, {0.0, -90.0}}) {
    RenderOptions options = options_of(50, 50, azimuth, elevation);
    options.projection = Projection::kOrthographic;
    options.zoom = 0.937;  // no ray runs in a plane between cells
    SCOPED_TRACE("azimuth " + std::to_string(azimuth) + " elevation " + std::to_string(elevation));
    EXPECT_GT(expect_same_hits(options, grid), 100);
  }
}

TEST(RayMarch, rays_that_run_in_a_grid_plane_hit_one_of_its_two_sides) {
  // A wall of voxels left of x = 4 and one right of it, in alternate rows; the rays' x is
  // exactly 4.
  GridSpec spec;
  spec.dims = {8, 8, 8};
  const Grid grid = make_test_grid(spec, false, false, [](const glm::ivec3& c) {
    return (c.x == 4 || c.x == 3) && c.z == 0 ? std::optional(TestVoxel{}) : std::nullopt;
  });
  ASSERT_TRUE(hits_renderer().set_grid(grid).ok());
  RenderOptions options = options_of(1, 8, 0, 0);
  options.matrix = {0.25, 0, 0, -1, 0, 0.25, 0, -1, 0, 0, -0.05, 0, 0, 0, 0, 1};
  const auto hits = hits_renderer().render_hits(options);
  ASSERT_TRUE(hits.ok()) << hits.error().message();
  for (const Hit& hit : *hits) {
    EXPECT_EQ(hit.cell.x, 4);
    EXPECT_EQ(hit.cell.z, 0);
    EXPECT_EQ(hit.face, 5);
  }
}

TEST(RayMarch, a_camera_inside_the_grid_sees_the_voxels_around_it) {
  const Grid grid = noise_grid(spec_of({48, 48, 48}, {1, 1, 1}), 0.03, 11);
  ASSERT_TRUE(hits_renderer().set_grid(grid).ok());
  const glm::dvec3 eye = grid.spec.world_from_grid({24.3, 22.9, 25.1});
  for (const glm::dvec3 target :
       {glm::dvec3(1, 0.2, 0.1), glm::dvec3(-1, -1, 0.4), glm::dvec3(0.1, 0.9, -1)}) {
    const glm::dmat4 clip_from_world = glm::perspective(1.2, 1.0, 0.1, 200.0) *
                                       glm::lookAt(eye, eye + target, glm::dvec3(0, 1, 0));
    RenderOptions options = options_of(48, 48, 0, 0);
    options.matrix = row_major(clip_from_world);
    EXPECT_GT(expect_same_hits(options, grid), 1500);
  }
}

TEST(RayMarch, a_section_plane_cuts_away_its_positive_side) {
  const Grid grid = noise_grid(spec_of({32, 40, 24}, {1, 0.5, 1}), 0.1, 5);
  ASSERT_TRUE(hits_renderer().set_grid(grid).ok());
  const glm::dvec3 middle = grid.spec.world_from_grid(0.5 * glm::dvec3(grid.spec.dims));
  for (const glm::dvec3 normal :
       {glm::dvec3(0, 0, 1), glm::dvec3(0, 0, -1), glm::dvec3(1, 2, 0.5)}) {
    RenderOptions options = options_of(48, 48, 25, 15);
    options.section = {normal.x, normal.y, normal.z, -glm::dot(normal, middle)};
    EXPECT_GT(expect_same_hits(options, grid), 300);
  }
}

TEST(RayMarch, the_longest_rays_are_marched_to_their_end) {
  // Every brick of the first 2047 columns is occupied beside the ray, so that it takes one step per
  // voxel; workaround loop_iterations_65535 is what would cut it short.
  GridSpec spec;
  spec.dims = {2048, 8, 8};
  const Grid grid = make_test_grid(spec, true, false, [](const glm::ivec3& c) {
    return c.y == 0 || c.x == 2047 ? std::optional(TestVoxel{{0, 255, 0, 255}, {}}) : std::nullopt;
  });
  ASSERT_TRUE(hits_renderer().set_grid(grid).ok());
  RenderOptions options = options_of(16, 16, 270, 0);
  // Looking along +x at y 2..6, z 2..6.
  options.matrix = {0, 0, 0.5, -2, 0, 0.5, 0, -2, 0.0009, 0, 0, -0.95, 0, 0, 0, 1};
  options.style = Style::kIso;
  const auto hits = hits_renderer().render_hits(options);
  ASSERT_TRUE(hits.ok()) << hits.error().message();
  for (const Hit& hit : *hits) ASSERT_EQ(hit.cell.x, 2047) << text(hit);
  hits_renderer().set_quality({4, 1 << 20});
  const auto image = hits_renderer().render(options, {});
  hits_renderer().set_quality({});
  ASSERT_TRUE(image.ok()) << image.error().message();
  for (size_t i = 0; i < image->rgba.size(); i += 4) {
    ASSERT_EQ(image->rgba[i + 0], 0);
    ASSERT_GT(image->rgba[i + 1], 200);
    ASSERT_EQ(image->rgba[i + 3], 255);
  }
}

}  // namespace
}  // namespace voxeld
