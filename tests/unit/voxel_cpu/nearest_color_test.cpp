// color=nearest: by hand, and against the oracle.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>
#include <utility>

#include "server/voxel/voxelize.h"
#include "tests/reference/color_oracle.h"
#include "tests/reference/nearest_oracle.h"

namespace voxeld {
namespace {

using Cell = std::array<int, 3>;
using Color = std::array<int, 4>;

constexpr glm::vec4 kRed(1, 0, 0, 1), kBlue(0, 0, 1, 1);

VoxelizeOptions nearest_in(const Cell& dims) {
  VoxelizeOptions options;
  options.placement.voxel_size = {1.0, 1.0, 1.0};
  options.placement.bounds = {0, 0, 0, double(dims[0]), double(dims[1]), double(dims[2])};
  options.color = ColorMode::kNearest;
  return options;
}

std::map<Cell, Color> colors_of(const Scene& scene, const VoxelizeOptions& options) {
  Voxelizer voxelizer;
  auto grid = voxelizer.voxelize(scene, options, {}, nullptr);
  EXPECT_TRUE(grid.ok()) << grid.error().message();
  std::map<Cell, Color> cells;
  for (const SparseTile& tile : grid->tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      const uint8_t* c = &tile.color[4 * voxel];
      cells[{x, y, z}] = {c[0], c[1], c[2], c[3]};
    });
  }
  return cells;
}

void add_triangle(Scene& scene, const std::array<glm::dvec3, 3>& corners,
                  const std::array<glm::vec4, 3>& colors) {
  MeshPart& part = scene.parts.emplace_back();
  part.positions.assign(corners.begin(), corners.end());
  part.colors.assign(colors.begin(), colors.end());
  part.indices = {0, 1, 2};
}

// A triangle over the whole of cell 0,0 at height z.
void add_sheet(Scene& scene, double z, const glm::vec4& color) {
  add_triangle(scene, {glm::dvec3(0, 0, z), {2, 0, z}, {0, 2, z}}, {color, color, color});
}

TEST(NearestColor, is_that_of_the_sheet_that_is_nearer_to_the_centre) {
  Scene scene;
  add_sheet(scene, 0.4, kRed);
  add_sheet(scene, 0.7, kBlue);
  add_sheet(scene, 0.8, kBlue);
  EXPECT_EQ(colors_of(scene, nearest_in({2, 2, 1})).at({0, 0, 0}), (Color{255, 0, 0, 255}));
  VoxelizeOptions average = nearest_in({2, 2, 1});
  average.color = ColorMode::kAverage;
  EXPECT_NE(colors_of(scene, average).at({0, 0, 0}), (Color{255, 0, 0, 255}));
}

TEST(NearestColor, at_equal_distances_the_smaller_colour_wins_in_any_order) {
  for (const bool swap : {false, true}) {
    Scene scene;  // q = 64 and 191 are as far from the centre
    add_sheet(scene, 64.0 / 256, swap ? kBlue : kRed);
    add_sheet(scene, 191.0 / 256, swap ? kRed : kBlue);
    EXPECT_EQ(colors_of(scene, nearest_in({2, 2, 1})).at({0, 0, 0}), (Color{0, 0, 255, 255}));
    // The diagonal of the cell, which both triangles share, is the nearest to the centre.
    Scene square;
    add_triangle(square, {glm::dvec3(0, 0, 0.3), {1, 0, 0.3}, {1, 1, 0.3}}, {kRed, kRed, kRed});
    add_triangle(square, {glm::dvec3(1, 1, 0.3), {0, 1, 0.3}, {0, 0, 0.3}}, {kBlue, kBlue, kBlue});
    if (swap) std::swap(square.parts[0], square.parts[1]);
    EXPECT_EQ(colors_of(square, nearest_in({1, 1, 1})).at({0, 0, 0}), (Color{0, 0, 255, 255}));
  }
}

TEST(NearestColor, is_taken_where_the_surface_is_nearest_and_not_in_its_middle) {
  // From red at x = 0 to blue at x = 2: at the centre's x, 1/2, a quarter of the way.
  Scene scene;
  add_triangle(scene, {glm::dvec3(0, 0, 0.2), {2, 0, 0.2}, {0, 2, 0.2}}, {kRed, kBlue, kRed});
  const Color color = colors_of(scene, nearest_in({2, 2, 1})).at({0, 0, 0});
  EXPECT_NEAR(color[0], 255 * reference::srgb_from_linear(0.75), 1);
  EXPECT_NEAR(color[2], 255 * reference::srgb_from_linear(0.25), 1);
}

TEST(NearestColor, keeps_alpha_where_some_colour_has_one) {
  Scene scene;
  add_sheet(scene, 0.5, {0.5f, 0.5f, 0.5f, 0.25f});
  EXPECT_EQ(colors_of(scene, nearest_in({2, 2, 1})).at({0, 0, 0})[3], 64);
}

struct ColoredSoup {
  Scene scene;
  std::vector<reference::Triangle> triangles;
  std::vector<std::array<glm::vec4, 3>> colors;
};

// Large and small triangles, slivers, segments and points; no dark colours, where sRGB is steep.
ColoredSoup make_soup(uint32_t seed, int count, double extent) {
  std::mt19937 random(seed);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random()) / 4294967296.0;
  };
  ColoredSoup soup;
  for (int t = 0; t < count; ++t) {
    const double size = t % 4 == 0 ? extent : t % 4 == 1 ? 0.3 : 3.0;
    const glm::dvec3 at(uniform(0, extent), uniform(0, extent), uniform(0, extent));
    std::array<glm::dvec3, 3> corners;
    std::array<glm::vec4, 3> colors;
    for (size_t i = 0; i < 3; ++i) {
      for (int c = 0; c < 3; ++c) {
        corners[i][c] = std::clamp(at[c] + uniform(-size, size), 0.0, extent);
        colors[i][c] = static_cast<float>(uniform(0.2, 1));
      }
      colors[i].w = 1.0f;
    }
    if (t % 17 == 3) corners[2] = corners[0];
    if (t % 17 == 5) corners[1] = corners[2] = corners[0];
    if (t % 17 == 7) {  // a segment, but for snapping, of the colours of its ends
      corners[2] = glm::mix(corners[0], corners[1], 0.37);
      colors[2] = glm::mix(colors[0], colors[1], 0.37f);
    }
    // Corners at one place get the mean of their colours: here they have one.
    for (const auto& [a, b] : {std::pair{0, 1}, {1, 2}, {0, 2}, {0, 1}}) {
      if (corners[size_t(a)] == corners[size_t(b)]) colors[size_t(b)] = colors[size_t(a)];
    }
    add_triangle(soup.scene, corners, colors);
    reference::Triangle triangle;
    for (size_t i = 0; i < 3; ++i) triangle[i] = {corners[i].x, corners[i].y, corners[i].z};
    soup.triangles.push_back(triangle);
    soup.colors.push_back(colors);
  }
  return soup;
}

// The largest difference between a colour and that of a triangle at a point.
double difference(const Color& got, const ColoredSoup& soup, const reference::SurfacePoint& point) {
  double largest = 0;
  for (int c = 0; c < 3; ++c) {
    double linear = 0;
    for (size_t i = 0; i < 3; ++i) {
      linear += point.barycentric[i] * static_cast<double>(soup.colors[point.triangle][i][c]);
    }
    const double want = 255 * reference::srgb_from_linear(linear);
    largest = std::max(largest, std::abs(want - got[static_cast<size_t>(c)]));
  }
  return largest;
}

TEST(NearestColor, is_that_of_the_nearest_point_by_the_oracle) {
  for (const uint32_t seed : {1u, 2u, 3u}) {
    constexpr int kSide = 24;
    ColoredSoup soup = make_soup(seed, 240, kSide);
    const VoxelizeOptions options = nearest_in({kSide, kSide, kSide});
    const auto colors = colors_of(soup.scene, options);
    const auto expected = reference::points_near_centres(
        soup.triangles, {{kSide, kSide, kSide}, {0, 0, 0}, {1, 1, 1}});
    ASSERT_EQ(colors.size(), expected.size());
    size_t ties = 0, wrong = 0;
    for (const auto& [cell, color] : colors) {
      const auto& points =
          expected.at(static_cast<size_t>(cell[0] + kSide * (cell[1] + kSide * cell[2])));
      const auto least = std::ranges::min_element(points, {}, &reference::SurfacePoint::squared);
      size_t near = 0;
      double error = 1e9;
      for (const reference::SurfacePoint& point : points) {
        if (point.squared > least->squared + 1e-12L) continue;
        ++near;
        error = std::min(error, difference(color, soup, point));
      }
      ties += near > 1 ? 1 : 0;
      // Half a step of the byte, and what 15 bits of weights lose.
      wrong += error > 1.0 ? 1 : 0;
    }
    EXPECT_EQ(wrong, 0u) << "of " << colors.size() << ", seed " << seed;
    EXPECT_GT(colors.size(), 3000u);
    EXPECT_LT(200 * ties, colors.size()) << ties;
    // Neither the order of triangles nor that of their corners matters.
    std::ranges::reverse(soup.scene.parts);
    for (MeshPart& part : soup.scene.parts) part.indices = {2, 0, 1};
    EXPECT_EQ(colors_of(soup.scene, options), colors);
  }
}

TEST(NearestColor, is_of_the_surface_voxel_inside_of_solids) {
  Scene scene;
  add_sheet(scene, 0.5, kRed);
  VoxelizeOptions options = nearest_in({2, 2, 2});
  options.fill = Fill::kBand;
  options.thickness = 1;
  const auto colors = colors_of(scene, options);
  EXPECT_EQ(colors.at({0, 0, 0}), (Color{255, 0, 0, 255}));
  EXPECT_EQ(colors.at({0, 0, 1}), (Color{0, 0, 0, 0})) << "no surface";
}

}  // namespace
}  // namespace voxeld
