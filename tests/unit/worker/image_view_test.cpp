// The part of a grid that a camera sees, against points that are projected one by one.
#include "server/worker/images/image_view.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/vec4.hpp>
#include <limits>
#include <random>

#include "server/render/camera.h"

namespace voxeld {
namespace {

RenderOptions seen_from(double azimuth, double zoom, Projection projection) {
  RenderOptions options;
  options.width = 640;
  options.height = 360;
  options.azimuth_deg = azimuth;
  options.zoom = zoom;
  options.projection = projection;
  const Camera camera = make_camera(options, box_subject({10, 20, 30}, {110, 220, 130}));
  std::array<double, 16> rows{};
  for (int i = 0; i < 16; ++i) rows[static_cast<size_t>(i)] = camera.clip_from_world[i % 4][i / 4];
  options.matrix = rows;
  return options;
}

GridSpec spec() {
  GridSpec spec;
  spec.dims = {1000, 1000, 1000};
  spec.origin_world = {10, 20, 30};
  spec.voxel_size = {0.1, 0.2, 0.1};
  return spec;
}

// Pixel of a point of the grid, and whether it is in the image.
struct Projected {
  double x, y;
  bool inside;
};
Projected project(const RenderOptions& options, const glm::dvec3& cell) {
  const glm::dvec3 p = spec().world_from_grid(cell);
  double clip[4];
  for (size_t row = 0; row < 4; ++row) {
    const double* m = options.matrix->data() + 4 * row;
    clip[row] = m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3];
  }
  const bool inside = clip[3] > 0 && std::abs(clip[0]) <= clip[3] && std::abs(clip[1]) <= clip[3] &&
                      std::abs(clip[2]) <= clip[3];
  return {clip[0] / clip[3] * options.width / 2, clip[1] / clip[3] * options.height / 2, inside};
}

TEST(ImageView, no_box_with_a_point_in_the_image_is_left_out) {
  std::mt19937 random(1);
  int seen = 0, unseen = 0;
  for (const Projection projection : {Projection::kPerspective, Projection::kOrthographic}) {
    for (const double zoom : {0.5, 3.0, 40.0}) {
      const RenderOptions options = seen_from(30 * zoom, zoom, projection);
      const ImageView view(options, spec());
      for (int i = 0; i < 300; ++i) {
        glm::ivec3 low;
        for (int c = 0; c < 3; ++c) low[c] = static_cast<int>(random() % 900);
        const CellBox box{low, low + static_cast<int>(random() % 100 + 1)};
        const bool sees = view.sees(box);
        (sees ? seen : unseen) += 1;
        for (int j = 0; j < 20 && !sees; ++j) {
          glm::dvec3 p;
          for (int c = 0; c < 3; ++c) {
            const double t = static_cast<double>(random()) / 4294967296.0;
            p[c] = box.min[c] + t * (box.max[c] - box.min[c]);
          }
          EXPECT_FALSE(project(options, p).inside);
        }
      }
    }
  }
  EXPECT_GT(seen, 300);
  EXPECT_GT(unseen, 300);
}

TEST(ImageView, cells_cut_away_by_the_section_are_not_seen) {
  RenderOptions options = seen_from(0, 1, Projection::kPerspective);
  const CellBox low{{0, 0, 0}, {100, 1000, 1000}}, high{{600, 0, 0}, {700, 1000, 1000}};
  EXPECT_TRUE(ImageView(options, spec()).sees(high));
  for (const double unit : {1.0, 1e-300, 1e306}) {
    options.section = {unit, 0, 0, -60 * unit};  // x > 60 goes; that is cell 500
    EXPECT_TRUE(ImageView(options, spec()).sees(low)) << unit;
    EXPECT_FALSE(ImageView(options, spec()).sees(high)) << unit;
  }
}

TEST(ImageView, cells_are_as_large_as_steps_between_their_corners) {
  for (const Projection projection : {Projection::kPerspective, Projection::kOrthographic}) {
    const RenderOptions options = seen_from(70, 2, projection);
    const CellBox box{{300, 400, 500}, {301, 401, 501}};
    double most = 0;
    for (int axis = 0; axis < 3; ++axis) {
      glm::dvec3 next(box.min);
      next[axis] += 1e-3;
      const Projected a = project(options, glm::dvec3(box.min)), b = project(options, next);
      most = std::max(most, std::hypot(a.x - b.x, a.y - b.y) * 1e3);
    }
    EXPECT_NEAR(ImageView(options, spec()).cell_pixels(box), most, 0.01 * most);
  }
}

TEST(ImageView, a_box_around_the_camera_has_cells_of_any_size) {
  RenderOptions options = seen_from(0, 1, Projection::kPerspective);
  // w = z - 50 in world space: the camera is in the grid.
  options.matrix = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, -51, 0, 0, 1, -50};
  EXPECT_EQ(ImageView(options, spec()).cell_pixels({{0, 0, 0}, {1000, 1000, 1000}}),
            std::numeric_limits<double>::infinity());
}

TEST(ImageView, levels_have_voxels_below_a_pixel) {
  EXPECT_EQ(level_of_pixels(5), 0);
  EXPECT_EQ(level_of_pixels(0.36), 0);
  EXPECT_EQ(level_of_pixels(0.34), 1);
  EXPECT_EQ(level_of_pixels(0.01), 6);
  EXPECT_EQ(level_of_pixels(0), 14);
  EXPECT_EQ(level_of_pixels(std::numeric_limits<double>::infinity()), 0);
}

}  // namespace
}  // namespace voxeld
