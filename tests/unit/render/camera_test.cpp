// Framing, conventions and inversion of cameras.
#include "server/render/camera.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <random>
#include <vector>

#include "tests/unit/base/points_passed.h"

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

Subject cube() {
  return box_subject({-1, -1, -1}, {1, 1, 1});
}

// The rectangle of the image, -1..1, that the points take.
struct Frame {
  glm::dvec2 low{1e9}, high{-1e9};
  double share() const { return 0.5 * std::max(high.x - low.x, high.y - low.y); }
};
Frame frame_of(const Camera& camera, const std::vector<glm::dvec3>& points) {
  Frame frame;
  for (const glm::dvec3& point : points) {
    const glm::dvec3 p = project(camera, point);
    EXPECT_LT(std::abs(p.z), 1.0);
    frame.low = glm::min(frame.low, glm::dvec2(p));
    frame.high = glm::max(frame.high, glm::dvec2(p));
  }
  return frame;
}

TEST(Camera, azimuth_0_looks_along_minus_z_with_x_to_the_right_and_y_up) {
  for (const Projection projection : {Projection::kPerspective, Projection::kOrthographic}) {
    const Camera camera = make_camera(options_of(projection, 0, 0), cube());
    EXPECT_NEAR(glm::length(glm::dvec2(project(camera, {0, 0, 0}))), 0.0, 1e-12);
    EXPECT_GT(project(camera, {0.5, 0, 0}).x, 0.1);
    EXPECT_NEAR(project(camera, {0.5, 0, 0}).y, 0.0, 1e-12);
    EXPECT_GT(project(camera, {0, 0.5, 0}).y, 0.1);
    EXPECT_LT(project(camera, {0, 0, 0.9}).z, project(camera, {0, 0, -0.9}).z);
  }
}

TEST(Camera, each_point_of_a_subject_can_be_cancelled) {
  RenderOptions options = options_of(Projection::kPerspective, 0, 0);
  EXPECT_GE(test::points_passed([&] { (void)make_camera(options, cube()); }), 8);
  options.turntable = 12;
  EXPECT_GE(test::points_passed([&] { (void)make_camera(options, cube()); }), 8);
}

TEST(Camera, a_turntable_looks_at_the_widest_point_of_each_height_alone) {
  Subject subject = cube();
  for (int i = 0; i < 1000; ++i) {
    const double at = 0.001 * i;
    subject.points_world.emplace_back(at, i % 2 == 0 ? 1 : -1, -at);
  }
  RenderOptions options = options_of(Projection::kPerspective, 30, 20);
  options.turntable = 12;
  const size_t count = subject.points_world.size();
  // One for each point, and 32 for each of the two heights.
  EXPECT_LE(test::points_passed([&] { (void)make_camera(options, subject); }),
            static_cast<int>(count) + 2 * 32);
  EXPECT_EQ(row_major(make_camera(options, subject).clip_from_world),
            row_major(make_camera(options, cube()).clip_from_world));
}

TEST(Camera, azimuth_90_looks_from_plus_x_and_elevation_90_from_above) {
  const Camera side = make_camera(options_of(Projection::kPerspective, 90, 0), cube());
  EXPECT_LT(project(side, {0.9, 0, 0}).z, project(side, {-0.9, 0, 0}).z);
  EXPECT_LT(project(side, {0, 0, 0.5}).x, -0.1);
  const Camera top = make_camera(options_of(Projection::kPerspective, 0, 90), cube());
  EXPECT_LT(project(top, {0, 0.9, 0}).z, project(top, {0, -0.9, 0}).z);
  EXPECT_GT(project(top, {0, 0, -0.5}).y, 0.1);  // what is behind is up
}

TEST(Camera, the_points_take_the_frames_share_of_the_image_and_its_middle) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (int round = 0; round < 200; ++round) {
    RenderOptions options =
        options_of(round % 2 == 0 ? Projection::kPerspective : Projection::kOrthographic,
                   180 * unit(random), 90 * unit(random));
    options.width = 50 + static_cast<int>(random() % 200);
    options.height = 50 + static_cast<int>(random() % 200);
    // A cloud in a part of its box.
    Subject subject{{10, -2, 5}, {14, 4, 6}, {}};
    for (int i = 0; i < 20; ++i) {
      const glm::dvec3 in_box(0.5 + 0.5 * unit(random), 0.3 + 0.3 * unit(random), 0.5);
      subject.points_world.push_back(glm::mix(subject.low_world, subject.high_world, in_box));
    }
    const Frame frame = frame_of(make_camera(options, subject), subject.points_world);
    EXPECT_NEAR(frame.share(), kFrameShare, 1e-9);
    EXPECT_NEAR(glm::length(frame.low + frame.high), 0.0, 1e-9);
  }
}

TEST(Camera, a_turntable_frames_all_views_alike) {
  const Subject subject{{-3, 0, -1}, {3, 2, 1}, {{-3, 0, 0.5}, {3, 1, -1}, {0, 2, 1}, {1, 0, 1}}};
  RenderOptions options = options_of(Projection::kPerspective, 0, 25);
  options.turntable = 24;
  const glm::dvec3 center(0, 1, 0);
  const glm::dvec3 above = project(make_camera(options, subject), center + glm::dvec3(0, 1, 0));
  double share_max = 0;
  for (int view = 0; view < options.turntable; ++view) {
    options.azimuth_deg = 15.0 * view;
    const Camera camera = make_camera(options, subject);
    // A point of the axis stands still.
    EXPECT_NEAR(glm::length(project(camera, center + glm::dvec3(0, 1, 0)) - above), 0.0, 1e-9);
    const Frame frame = frame_of(camera, subject.points_world);
    for (const glm::dvec2& corner : {frame.low, frame.high}) {
      EXPECT_LE(std::max(std::abs(corner.x), std::abs(corner.y)), kFrameShare + 1e-9);
    }
    share_max = std::max(share_max, frame.share());
  }
  EXPECT_GT(share_max, 0.85);
}

TEST(Camera, zoom_magnifies_about_the_middle) {
  RenderOptions options = options_of(Projection::kPerspective, 20, 10);
  const Camera one = make_camera(options, cube());
  options.zoom = 3;
  const Camera three = make_camera(options, cube());
  const glm::dvec3 p(0.3, -0.2, 0.9);
  EXPECT_NEAR(project(three, p).x, 3 * project(one, p).x, 1e-12);
  EXPECT_NEAR(project(three, p).y, 3 * project(one, p).y, 1e-12);
}

TEST(Camera, a_matrix_is_taken_row_by_row_as_it_is) {
  RenderOptions options;
  options.matrix = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};
  const Camera camera = make_camera(options, cube());
  EXPECT_EQ(camera.clip_from_world[3][0], 4);  // column 3, row 0
  EXPECT_EQ(camera.clip_from_world[0][3], 13);
}

TEST(ImageRays, start_on_the_near_and_end_on_the_far_plane) {
  GridSpec spec;
  spec.dims = {10, 20, 30};
  spec.origin_world = {100, -5, 3};
  spec.voxel_size = {0.5, 0.25, 2};
  const Camera camera =
      make_camera(options_of(Projection::kPerspective, 33, -12),
                  box_subject(spec.origin_world, spec.world_from_grid({10, 20, 30})));
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
  // The image may be shifted, so that its middle is not where the camera points.
  const glm::dvec3 middle =
      spec.world_from_grid(glm::dvec3(rays->near_plane[0]) / rays->near_plane[0].w);
  const glm::dvec3 further = project(camera, middle - rays->to_eye);
  EXPECT_NEAR(further.x, 0.0, 1e-9);
  EXPECT_NEAR(further.y, 0.0, 1e-9);
  EXPECT_GT(further.z, -1.0);
}

TEST(ImageRays, singular_and_absurd_matrices_are_invalid_options) {
  const GridSpec spec;
  for (const double value : {0.0, 1.0, 1e300, std::nan("")}) {
    RenderOptions options;
    options.matrix.emplace();
    options.matrix->fill(value);
    const auto rays = image_rays(make_camera(options, cube()), spec, {0, 0, 0});
    ASSERT_FALSE(rays.ok()) << value;
    EXPECT_EQ(rays.error().code, ErrorCode::kInvalidOption);
  }
}

}  // namespace
}  // namespace voxeld
