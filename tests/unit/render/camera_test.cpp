// Framing, conventions and inversion of cameras.
#include "server/render/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <random>

namespace voxeld {
namespace {

glm::dvec3 project(const Camera& camera, const glm::dvec3& world) {
  const glm::dvec4 clip = camera.clip_from_world * glm::dvec4(world, 1.0);
  return glm::dvec3(clip) / clip.w;
}

RenderOptions options_of(Projection projection, double azimuth, double elevation) {
  RenderOptions options;
  options.projection = projection;
  options.azimuth_deg = azimuth;
  options.elevation_deg = elevation;
  return options;
}

TEST(Camera, azimuth_0_looks_along_minus_z_with_x_to_the_right_and_y_up) {
  for (const Projection projection : {Projection::kPerspective, Projection::kOrthographic}) {
    const Camera camera = make_camera(options_of(projection, 0, 0), {-1, -1, -1}, {1, 1, 1});
    EXPECT_NEAR(glm::length(glm::dvec2(project(camera, {0, 0, 0}))), 0.0, 1e-12);
    EXPECT_GT(project(camera, {0.5, 0, 0}).x, 0.1);
    EXPECT_NEAR(project(camera, {0.5, 0, 0}).y, 0.0, 1e-12);
    EXPECT_GT(project(camera, {0, 0.5, 0}).y, 0.1);
    EXPECT_LT(project(camera, {0, 0, 0.9}).z, project(camera, {0, 0, -0.9}).z);
  }
}

TEST(Camera, azimuth_90_looks_from_plus_x_and_elevation_90_from_above) {
  const Camera side =
      make_camera(options_of(Projection::kPerspective, 90, 0), {-1, -1, -1}, {1, 1, 1});
  EXPECT_LT(project(side, {0.9, 0, 0}).z, project(side, {-0.9, 0, 0}).z);
  EXPECT_LT(project(side, {0, 0, 0.5}).x, -0.1);
  const Camera top =
      make_camera(options_of(Projection::kPerspective, 0, 90), {-1, -1, -1}, {1, 1, 1});
  EXPECT_LT(project(top, {0, 0.9, 0}).z, project(top, {0, -0.9, 0}).z);
  EXPECT_GT(project(top, {0, 0, -0.5}).y, 0.1);  // what is behind is up
}

TEST(Camera, the_bounding_sphere_fits_the_smaller_side_at_zoom_1) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const glm::dvec3 low(10, -2, 5), high(14, 4, 6);
  const glm::dvec3 center = 0.5 * (low + high);
  const double radius = 0.5 * glm::length(high - low);
  for (const Projection projection : {Projection::kPerspective, Projection::kOrthographic}) {
    for (const auto& [width, height] : {std::pair{200, 100}, {100, 200}, {64, 64}}) {
      RenderOptions options = options_of(projection, 180 * unit(random), 90 * unit(random));
      options.width = width;
      options.height = height;
      const Camera camera = make_camera(options, low, high);
      double extent_max = 0;
      for (int i = 0; i < 20000; ++i) {
        const glm::dvec3 direction(unit(random), unit(random), unit(random));
        const glm::dvec3 p = project(camera, center + radius * glm::normalize(direction));
        ASSERT_LT(std::abs(p.z), 1.0);
        ASSERT_LE(std::abs(p.x), 1.0 + 1e-9);
        ASSERT_LE(std::abs(p.y), 1.0 + 1e-9);
        extent_max = std::max(extent_max, width <= height ? std::abs(p.x) : std::abs(p.y));
      }
      EXPECT_GT(extent_max, 0.99);  // and no smaller than it must be
    }
  }
}

TEST(Camera, zoom_magnifies_about_the_middle) {
  RenderOptions options = options_of(Projection::kPerspective, 20, 10);
  const Camera one = make_camera(options, {-1, -1, -1}, {1, 1, 1});
  options.zoom = 3;
  const Camera three = make_camera(options, {-1, -1, -1}, {1, 1, 1});
  const glm::dvec3 p(0.3, -0.2, 0.9);
  EXPECT_NEAR(project(three, p).x, 3 * project(one, p).x, 1e-12);
  EXPECT_NEAR(project(three, p).y, 3 * project(one, p).y, 1e-12);
}

TEST(Camera, a_matrix_is_taken_row_by_row_as_it_is) {
  RenderOptions options;
  options.matrix = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};
  const Camera camera = make_camera(options, {0, 0, 0}, {1, 1, 1});
  EXPECT_EQ(camera.clip_from_world[3][0], 4);  // column 3, row 0
  EXPECT_EQ(camera.clip_from_world[0][3], 13);
}

TEST(ImageRays, start_on_the_near_and_end_on_the_far_plane) {
  GridSpec spec;
  spec.dims = {10, 20, 30};
  spec.origin_world = {100, -5, 3};
  spec.voxel_size = {0.5, 0.25, 2};
  const Camera camera = make_camera(options_of(Projection::kPerspective, 33, -12),
                                    spec.origin_world, spec.world_from_grid({10, 20, 30}));
  const auto rays = image_rays(camera, spec, spec.world_from_grid({5, 10, 15}));
  ASSERT_TRUE(rays.ok()) << rays.error().message();
  for (const double z : {-1.0, 1.0}) {
    const auto& plane = z < 0 ? rays->near_plane : rays->far_plane;
    const glm::dvec4 at = plane[0] + 0.3 * plane[1] - 0.8 * plane[2];
    const glm::dvec3 clip = project(camera, spec.world_from_grid(glm::dvec3(at) / at.w));
    EXPECT_NEAR(clip.x, 0.3, 1e-9);
    EXPECT_NEAR(clip.y, -0.8, 1e-9);
    EXPECT_NEAR(clip.z, z, 1e-9);
  }
  EXPECT_NEAR(glm::dot(rays->right, rays->up), 0.0, 1e-6);
  EXPECT_NEAR(glm::dot(rays->right, rays->to_eye), 0.0, 1e-6);
}

TEST(ImageRays, singular_and_absurd_matrices_are_invalid_options) {
  const GridSpec spec;
  for (const double value : {0.0, 1.0, 1e300, std::nan("")}) {
    RenderOptions options;
    options.matrix.emplace();
    options.matrix->fill(value);
    const auto rays = image_rays(make_camera(options, {0, 0, 0}, {1, 1, 1}), spec, {0, 0, 0});
    ASSERT_FALSE(rays.ok()) << value;
    EXPECT_EQ(rays.error().code, ErrorCode::kInvalidOption);
  }
}

}  // namespace
}  // namespace voxeld
