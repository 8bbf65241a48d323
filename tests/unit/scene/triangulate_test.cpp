#include "server/scene/core/triangulate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

namespace voxeld {
namespace {

using Polygon = std::vector<glm::dvec3>;

glm::dvec3 area_vector(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  return glm::cross(b - a, c - a) / 2.0;
}

glm::dvec3 polygon_area(const Polygon& polygon) {
  glm::dvec3 sum{0.0};
  for (size_t i = 2; i < polygon.size(); ++i) {
    sum += area_vector(polygon[0], polygon[i - 1], polygon[i]);
  }
  return sum;
}

// For a planar simple polygon: n - 2 triangles, none turned over, whose areas sum to the polygon's.
// Then none lies outside and none overlaps another.
void expect_exact_cover(const Polygon& polygon, double tolerance = 1e-9) {
  std::vector<uint32_t> indices;
  triangulate_polygon(polygon, indices);
  ASSERT_EQ(indices.size(), 3 * (polygon.size() - 2));
  const glm::dvec3 whole = polygon_area(polygon);
  const double size = glm::length(whole);
  double sum = 0.0;
  for (size_t i = 0; i < indices.size(); i += 3) {
    ASSERT_LT(indices[i], polygon.size());
    const glm::dvec3 area =
        area_vector(polygon[indices[i]], polygon[indices[i + 1]], polygon[indices[i + 2]]);
    EXPECT_GE(glm::dot(area, whole), -tolerance * size * size) << "triangle " << i / 3;
    sum += glm::length(area);
  }
  EXPECT_NEAR(sum, size, tolerance * size);
}

Polygon flat(const std::vector<glm::dvec2>& points) {
  Polygon polygon;
  for (const auto& p : points) polygon.emplace_back(p.x, p.y, 0.0);
  return polygon;
}

Polygon reversed(Polygon polygon) {
  std::reverse(polygon.begin(), polygon.end());
  return polygon;
}

// Into a plane that is parallel to no axis.
Polygon tilted(const Polygon& polygon) {
  const glm::dvec3 u = glm::normalize(glm::dvec3(1.0, 2.0, -0.5));
  const glm::dvec3 v = glm::normalize(glm::cross(u, glm::dvec3(0.3, -0.4, 0.9)));
  Polygon out;
  for (const auto& p : polygon) out.push_back(glm::dvec3(7.0, -3.0, 11.0) + p.x * u + p.y * v);
  return out;
}

TEST(Triangulate, appends_to_existing_triangles) {
  std::vector<uint32_t> indices = {9};
  triangulate_polygon(flat({{0, 0}, {1, 0}, {0, 1}}), indices);
  EXPECT_EQ(indices, (std::vector<uint32_t>{9, 0, 1, 2}));
}

TEST(Triangulate, fewer_than_three_corners_give_nothing) {
  std::vector<uint32_t> indices;
  triangulate_polygon(flat({{0, 0}, {1, 0}}), indices);
  EXPECT_TRUE(indices.empty());
}

TEST(Triangulate, convex_quad_is_cut_from_its_first_corner) {
  std::vector<uint32_t> indices;
  triangulate_polygon(flat({{0, 0}, {1, 0}, {1, 1}, {0, 1}}), indices);
  EXPECT_EQ(indices, (std::vector<uint32_t>{0, 1, 2, 0, 2, 3}));
}

TEST(Triangulate, concave_quads_are_cut_inside_wherever_the_notch_is) {
  Polygon arrow = flat({{0, 0}, {4, -3}, {1, 0}, {4, 3}});
  for (int turn = 0; turn < 4; ++turn) {
    std::rotate(arrow.begin(), arrow.begin() + 1, arrow.end());
    expect_exact_cover(arrow);
    expect_exact_cover(reversed(arrow));
    expect_exact_cover(tilted(arrow));
  }
}

TEST(Triangulate, concave_polygons_are_covered_exactly) {
  const Polygon shapes[] = {
      flat({{0, 0}, {6, 0}, {6, 2}, {2, 2}, {2, 6}, {0, 6}}),                  // L
      flat({{0, 0}, {7, 0}, {7, 5}, {5, 5}, {5, 2}, {2, 2}, {2, 5}, {0, 5}}),  // U
      flat({{0, 0}, {9, 0}, {9, 1}, {1, 1}, {1, 2}, {9, 2}, {9, 3}, {0, 3}}),  // comb
      flat({{0, 0},
            {10, 0},
            {10, 10},
            {2, 10},
            {2, 4},
            {6, 4},
            {6, 6},
            {4, 6},
            {4, 8},
            {8, 8},
            {8, 2},
            {0, 2}})};  // spiral
  for (const Polygon& shape : shapes) {
    expect_exact_cover(shape);
    expect_exact_cover(reversed(shape));
    expect_exact_cover(tilted(shape));
  }
}

TEST(Triangulate, collinear_corners_keep_the_count_and_the_area) {
  expect_exact_cover(
      flat({{0, 0}, {1, 0}, {2, 0}, {3, 0}, {3, 3}, {2, 3}, {1, 3}, {0, 3}, {0, 1}}));
}

TEST(Triangulate, duplicate_corners_keep_the_count_and_the_area) {
  expect_exact_cover(
      flat({{0, 0}, {6, 0}, {6, 0}, {6, 2}, {2, 2}, {2, 2}, {2, 2}, {2, 6}, {0, 6}}));
}

TEST(Triangulate, a_hole_joined_by_a_bridge_stays_a_hole) {
  // The square ring, walked once: outer, along the bridge, inner the other way round, back.
  expect_exact_cover(
      flat({{0, 0}, {9, 0}, {9, 9}, {0, 9}, {0, 0}, {3, 3}, {3, 6}, {6, 6}, {6, 3}, {3, 3}}));
}

TEST(Triangulate, corners_that_touch_an_edge_are_no_problem) {
  expect_exact_cover(flat({{0, 0}, {4, 0}, {8, 0}, {8, 8}, {4, 0}, {0, 8}}));
}

TEST(Triangulate, random_star_shaped_polygons_are_covered_exactly) {
  std::mt19937 random(20240607);
  std::uniform_real_distribution<double> radius(0.05, 1.0);
  for (int round = 0; round < 300; ++round) {
    const int count = 5 + round % 60;
    std::vector<glm::dvec2> points;
    for (int i = 0; i < count; ++i) {
      const double angle = 6.283185307179586 * i / count, r = radius(random);
      points.emplace_back(r * std::cos(angle), r * std::sin(angle));
    }
    SCOPED_TRACE(round);
    expect_exact_cover(tilted(flat(points)));
  }
}

TEST(Triangulate, degenerate_and_crossing_polygons_keep_their_triangle_count) {
  const Polygon shapes[] = {flat({{0, 0}, {1, 0}, {2, 0}, {3, 0}, {4, 0}}),      // a line
                            flat({{1, 1}, {1, 1}, {1, 1}, {1, 1}, {1, 1}}),      // a point
                            flat({{0, 0}, {4, 4}, {4, 0}, {0, 4}, {2, 9}}),      // crosses itself
                            flat({{0, 0}, {5, 0}, {1, 3}, {2.5, -2}, {4, 3}})};  // pentagram
  for (const Polygon& shape : shapes) {
    std::vector<uint32_t> indices;
    triangulate_polygon(shape, indices);
    EXPECT_EQ(indices.size(), 3 * (shape.size() - 2));
    for (const uint32_t index : indices) EXPECT_LT(index, shape.size());
  }
}

// A saw whose teeth all reach across it: every second corner is reflex.
Polygon big_saw(int count) {
  std::vector<glm::dvec2> points;
  for (int i = 0; i < count / 2; ++i) points.emplace_back(i, i % 2 == 0 ? 0.0 : 1000.0);
  for (int i = count / 2; i-- > 0;) points.emplace_back(i, 10.0 + (i % 2 == 0 ? 0.0 : 1000.0));
  return flat(points);
}

// A spiral of many turns: long thin ears.
Polygon big_spiral(int count) {
  std::vector<glm::dvec2> points;
  const auto point = [&](int i, double offset) {
    const double angle = 0.05 * i, r = 1.0 + angle + offset;
    points.emplace_back(r * std::cos(angle), r * std::sin(angle));
  };
  for (int i = 0; i < count / 2; ++i) point(i, 0.0);
  for (int i = count / 2; i-- > 0;) point(i, 2.0);
  return flat(points);
}

// A comb seen from very far away in one axis: all corners but one fall into one column of cells.
Polygon clustered_comb(int count) {
  std::vector<glm::dvec2> points = {{-1e9, -1e9}, {1.0, -1.0}};
  for (int i = 0; i < count - 2; ++i) {
    points.emplace_back(i % 2 == 0 ? 1.0 : 0.0, i / static_cast<double>(count));
  }
  return flat(points);
}

// Corners anywhere: it crosses itself everywhere.
Polygon big_tangle(int count) {
  std::vector<glm::dvec2> points;
  uint32_t state = 1;
  const auto random = [&] {
    state = state * 1664525u + 1013904223u;
    return (state >> 8) / 16777216.0;
  };
  for (int i = 0; i < count; ++i) points.emplace_back(random(), random());
  return flat(points);
}

// Thousands of corners at each of a few places, round and round or to and fro: 1.5 KB in a zip.
Polygon few_places(const std::vector<glm::dvec2>& places, int count) {
  std::vector<glm::dvec2> points;
  for (int i = 0; i < count; ++i) points.push_back(places[static_cast<size_t>(i) % places.size()]);
  return flat(points);
}

// A polygon that cost a round per ear would run into the test's time limit.
TEST(Triangulate, the_largest_polygons_cost_no_round_per_ear) {
  constexpr int kCount = 65'536;
  for (const Polygon& polygon :
       {big_saw(kCount), big_spiral(kCount), clustered_comb(kCount), big_tangle(kCount),
        few_places({{0, 0}, {1, 0}, {1, 1}, {0, 1}}, kCount - 1),
        few_places({{0, 0}, {1, 1}, {1, 0}, {0, 1}}, kCount - 1),
        few_places({{0, 0}, {1, 0}, {0.5, 0.5}, {1, 1}, {0, 1}}, kCount - 1)}) {
    std::vector<uint32_t> indices;
    triangulate_polygon(polygon, indices);
    EXPECT_EQ(indices.size(), 3 * (polygon.size() - 2));
  }
  expect_exact_cover(big_saw(4096));
  expect_exact_cover(big_spiral(4096));
}

}  // namespace
}  // namespace voxeld
