// Smooth meshes of balls, compared with the ball.
#include "server/formats/mesh/smooth_mesh.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

using mesh::Face;
using mesh::SurfaceMesh;
using mesh::Vertex;

constexpr double kCentre = 21.3, kRadius = 12.4;  // of the ball, in cells

double distance_of(int x, int y, int z) {
  return std::hypot(x + 0.5 - kCentre, y + 0.5 - kCentre, z + 0.5 - kCentre) - kRadius;
}

// The part of a voxel inside, by 8x8x8 points.
double coverage_of(int x, int y, int z) {
  int inside = 0;
  for (int i = 0; i < 512; ++i) {
    const double u = x + ((i & 7) + 0.5) / 8, v = y + ((i >> 3 & 7) + 0.5) / 8,
                 w = z + ((i >> 6) + 0.5) / 8;
    inside += std::hypot(u - kCentre, v - kCentre, w - kCentre) < kRadius ? 1 : 0;
  }
  return inside / 512.0;
}

// The voxels for which is_voxel(distance of the centre) holds.
template <typename Test>
Grid ball_of(const ChannelSet& channels, const std::string& fill, Test&& is_voxel) {
  std::vector<test::TestVoxel> voxels;
  for (int z = 0; z < 44; ++z) {
    for (int y = 0; y < 44; ++y) {
      for (int x = 0; x < 44; ++x) {
        const double distance = distance_of(x, y, z);
        if (!is_voxel(distance)) continue;
        test::TestVoxel voxel{{x, y, z}};
        voxel.color = x < 21 ? std::array<uint8_t, 4>{255, 0, 0, 255}
                             : std::array<uint8_t, 4>{0, 0, 255, 255};
        voxel.distance = static_cast<int16_t>(std::lround(distance * kDistanceSteps));
        if (channels.coverage) {
          voxel.coverage = static_cast<uint8_t>(std::lround(255 * coverage_of(x, y, z)));
          if (voxel.coverage == 0) continue;
        }
        voxels.push_back(voxel);
      }
    }
  }
  Grid grid = test::grid_of({44, 44, 44}, voxels, channels);
  grid.meta = GridMeta::parse(R"({"options":{"fill":")" + fill + R"("}})");
  return grid;
}

SurfaceMesh smooth(const Grid& grid) {
  auto mesh = mesh::make_smooth_mesh(grid, "ply");
  EXPECT_TRUE(mesh) << mesh.error().message();
  return std::move(*mesh);
}

double radius_at(const Vertex& vertex) {
  const auto& [x, y, z] = vertex.p_grid;
  return std::hypot(x - kCentre, y - kCentre, z - kCentre);
}

// Each vertex is within `tolerance` voxels of the ball, its normal points outwards within 0.2
// radians but for `normal_dot`, and each edge has two faces in opposite directions.
void expect_ball(const SurfaceMesh& mesh, double tolerance, double normal_dot) {
  ASSERT_GT(mesh.vertices.size(), 1000U);
  ASSERT_EQ(mesh.normals.size(), mesh.vertices.size());
  double worst = 0, dot_min = 1;
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    worst = std::max(worst, std::abs(radius_at(mesh.vertices[i]) - kRadius));
    double dot = 0;
    for (size_t c = 0; c < 3; ++c) {
      dot += (mesh.vertices[i].p_grid[c] - kCentre) * mesh.normals[i][c];
    }
    dot_min = std::min(dot_min, dot / radius_at(mesh.vertices[i]));
  }
  EXPECT_LE(worst, tolerance);
  EXPECT_GE(dot_min, normal_dot);
  std::map<std::pair<uint32_t, uint32_t>, int> edges;
  for (const Face& face : mesh.faces.span()) {
    ASSERT_TRUE(face.is_quad());
    for (size_t i = 0; i < 4; ++i) ++edges[{face.corners[i], face.corners[(i + 1) % 4]}];
  }
  for (const auto& [edge, count] : edges) {
    ASSERT_EQ(count, 1);
    ASSERT_EQ((edges.count({edge.second, edge.first})), 1U);
  }
}

TEST(SmoothMesh, of_a_band_is_where_the_distance_is_zero) {
  const Grid band =
      ball_of({.distance = true}, "band", [](double distance) { return std::abs(distance) < 3; });
  // A vertex is the mean of points on the ball that are up to a voxel apart: it lies below it.
  expect_ball(smooth(band), 0.05, 0.99);
}

TEST(SmoothMesh, of_a_solid_with_distances_is_where_they_are_zero) {
  const Grid solid =
      ball_of({.distance = true}, "solid", [](double distance) { return distance < 0.8; });
  expect_ball(smooth(solid), 0.05, 0.99);
}

TEST(SmoothMesh, in_world_units_is_where_they_are_zero_though_voxels_are_no_cubes) {
  constexpr double kHeight = 2;  // of a voxel; its other edges are 1
  const auto world_distance = [](double x, double y, double z) {
    return std::hypot(x - kCentre, y - kCentre, kHeight * z - kCentre) - kRadius;
  };
  for (const auto& [fill, least, most] :
       {std::tuple{"band", -4.0, 4.0}, std::tuple{"solid", -100.0, 1.6}}) {
    std::vector<test::TestVoxel> voxels;
    for (int z = 0; z < 22; ++z) {
      for (int y = 0; y < 44; ++y) {
        for (int x = 0; x < 44; ++x) {
          const double distance = world_distance(x + 0.5, y + 0.5, z + 0.5);
          if (distance < least || distance > most) continue;
          test::TestVoxel voxel{{x, y, z}};
          voxel.distance = static_cast<int16_t>(std::lround(distance * kDistanceSteps));
          voxels.push_back(voxel);
        }
      }
    }
    Grid grid = test::grid_of({44, 44, 22}, voxels, {.distance = true});
    grid.spec.voxel_size = {1, 1, kHeight};
    grid.meta = GridMeta::parse(R"({"options":{"distance":"world","fill":")" + std::string(fill) +
                                R"("}})");
    const SurfaceMesh mesh = smooth(grid);
    ASSERT_GT(mesh.vertices.size(), 1000U);
    for (const Vertex& vertex : mesh.vertices.span()) {
      const auto& [x, y, z] = vertex.p_grid;
      ASSERT_NEAR(world_distance(x, y, z), 0, 0.15) << fill;
    }
  }
}

TEST(SmoothMesh, of_a_solid_with_coverage_is_where_half_of_a_voxel_is_covered) {
  const Grid solid =
      ball_of({.coverage = true}, "solid", [](double distance) { return distance < 1; });
  expect_ball(smooth(solid), 0.25, 0.95);
}

TEST(SmoothMesh, of_voxels_alone_is_within_a_voxel_of_the_solid) {
  const Grid solid = ball_of({}, "solid", [](double distance) { return distance < 0; });
  expect_ball(smooth(solid), 0.7, 0.9);
  // Distances of a surface do not tell on which side empty cells are.
  const Grid surface =
      ball_of({.distance = true}, "surface", [](double distance) { return distance < 0; });
  const SurfaceMesh same = smooth(surface), mesh = smooth(solid);
  ASSERT_EQ(same.vertices.size(), mesh.vertices.size());
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    ASSERT_EQ(same.vertices[i].p_grid, mesh.vertices[i].p_grid);
  }
}

TEST(SmoothMesh, vertices_have_the_mean_colour_of_their_voxels) {
  const Grid solid =
      ball_of({.color = true}, "solid", [](double distance) { return distance < 0; });
  const SurfaceMesh mesh = smooth(solid);
  size_t red = 0, blue = 0, mixed = 0;
  for (const Vertex& vertex : mesh.vertices.span()) {
    const bool has_red = mesh::byte_of(vertex.color, 0) > 0;
    const bool has_blue = mesh::byte_of(vertex.color, 2) > 0;
    ASSERT_TRUE(has_red || has_blue);
    red += has_red && !has_blue ? 1 : 0;
    blue += has_blue && !has_red ? 1 : 0;
    mixed += has_red && has_blue ? 1 : 0;
    // Only cells on both sides of x = 21 are mixed.
    if (has_red && has_blue) {
      ASSERT_NEAR(vertex.p_grid[0], 21, 0.5);
    }
  }
  EXPECT_GT(red, 400U);
  EXPECT_GT(blue, 400U);
  EXPECT_GT(mixed, 50U);
}

TEST(SmoothMesh, voxels_inside_without_a_colour_do_not_darken_vertices) {
  Grid solid = ball_of({.color = true, .distance = true, .coverage = true}, "solid",
                       [](double distance) { return distance < 1; });
  for (SparseTile& tile : solid.tiles) {
    for (size_t i = 0; i < tile.distance.size(); ++i) {
      // Cells that the surface does not touch.
      if (tile.distance[i] > -0.87 * kDistanceSteps) continue;
      std::fill_n(tile.color.begin() + static_cast<ptrdiff_t>(4 * i), 4, uint8_t{0});
    }
  }
  for (const bool has_distance : {true, false}) {
    solid.channels.distance = has_distance;
    const SurfaceMesh mesh = smooth(solid);
    ASSERT_GT(mesh.vertices.size(), 1000U);
    for (const Vertex& vertex : mesh.vertices.span()) {
      ASSERT_EQ(mesh::byte_of(vertex.color, 3), 255);
      if (vertex.p_grid[0] > 22) {
        ASSERT_EQ(vertex.color, mesh::rgba({0, 0, 255}));
      }
      if (vertex.p_grid[0] < 20) {
        ASSERT_EQ(vertex.color, mesh::rgba({255, 0, 0}));
      }
    }
  }
}

TEST(SmoothMesh, a_solid_of_full_nodes_has_its_surface_at_their_sides) {
  Grid grid = test::grid_of({32, 32, 32}, {}, {.coverage = true});
  SparseTile& tile = grid.tiles.emplace_back();
  tile.full = {{0, 0}};
  grid.meta = GridMeta::parse(R"({"options":{"fill":"solid"}})");
  const SurfaceMesh mesh = smooth(grid);
  EXPECT_EQ(mesh.faces.size(), 6U * 64);
  for (const Vertex& vertex : mesh.vertices.span()) {
    for (const float p : vertex.p_grid) ASSERT_TRUE(p >= 0 && p <= 8);
  }
}

}  // namespace
}  // namespace voxeld
