// Snapping and clipping.
#include "server/voxel/triangles/snap.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <tuple>

#include "server/base/parallel.h"
#include "server/voxel/triangles/clip.h"
#include "server/voxel/triangles/split.h"
#include "tests/reference/touch_oracle.h"
#include "tests/unit/base/points_passed.h"

namespace voxeld {
namespace {

GridSpec unit_spec(int side) {
  GridSpec spec;
  spec.dims = glm::ivec3(side);
  return spec;
}

Scene scene_of(std::vector<glm::dvec3> positions) {
  Scene scene;
  MeshPart part;
  for (uint32_t i = 0; i < positions.size(); ++i) part.indices.push_back(i);
  part.positions = std::move(positions);
  scene.parts.push_back(std::move(part));
  return scene;
}

TEST(Snap, takes_the_sub_voxel_below_and_keeps_the_far_face_inside) {
  EXPECT_EQ(snap_coordinate(0.0, 8), 0);
  EXPECT_EQ(snap_coordinate(1.0 / 256, 8), 1);
  EXPECT_EQ(snap_coordinate(3.0, 8), 768);
  EXPECT_EQ(snap_coordinate(std::nextafter(3.0, 0.0), 8), 767);
  EXPECT_EQ(snap_coordinate(8.0, 8), 2047);
  EXPECT_EQ(snap_coordinate(8.0 + 1.0 / 4096, 8), 2047);
  EXPECT_EQ(snap_coordinate(8.0 + 1.0 / 2048, 8), 2048);
  EXPECT_EQ(snap_coordinate(-1.0 / 4096, 8), 0);
  EXPECT_EQ(snap_coordinate(-1.0 / 2048, 8), -1);
  EXPECT_EQ(snap_coordinate(-1.0, 8), -256);
  EXPECT_EQ(snap_coordinate(9.0, 8), 9 * 256);
}

TEST(Snap, agrees_with_the_oracle) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(-1.0, 2049.0);
  for (int i = 0; i < 100'000; ++i) {
    const double p = i % 3 == 0 ? std::round(uniform(random) * 4) / 4 : uniform(random);
    ASSERT_EQ(2 * snap_coordinate(p, 2048) + 1, reference::snap_512(p, 2048)) << p;
  }
}

TEST(Snap, drops_triangles_that_miss_the_grid) {
  const auto mesh = snap_scene(
      scene_of({{-0.5, 1, 1}, {-0.5, 2, 1}, {-0.5, 1, 2}, {9, 1, 1}, {20, 1, 1}, {9, 9, 9}}),
      glm::dmat4(1.0), unit_spec(8));
  ASSERT_TRUE(mesh.ok());
  EXPECT_TRUE(mesh->triangles.empty());
}

TEST(Snap, groups_parts_by_image) {
  Scene scene;
  scene.images.resize(2);
  for (const int image : {1, 0, -1, 1}) {
    Material material;
    material.image = image;
    scene.materials.push_back(material);
    Scene one = scene_of({{1, 1, 1}, {2, 1, 1}, {1, 2, 1}});
    one.parts[0].uvs.resize(3);
    one.parts[0].material = static_cast<int>(scene.materials.size()) - 1;
    scene.parts.push_back(one.parts[0]);
  }
  const auto mesh = snap_scene(scene, glm::dmat4(1.0), unit_spec(8));
  ASSERT_TRUE(mesh.ok());
  std::vector<uint32_t> parts;
  for (const SnappedTriangle& triangle : mesh->triangles) parts.push_back(triangle.part);
  EXPECT_EQ(parts, (std::vector<uint32_t>{2, 1, 0, 3}));
}

TEST(Snap, clipped_triangles_stay_in_the_box_and_keep_their_weights) {
  const glm::dvec3 a(-50, 4, 4), b(60, 4, 4), c(4, 90, 4.5);
  const auto mesh = snap_scene(scene_of({a, b, c}), glm::dmat4(1.0), unit_spec(8));
  ASSERT_TRUE(mesh.ok());
  ASSERT_GE(mesh->triangles.size(), 2u);
  for (const SnappedTriangle& triangle : mesh->triangles) {
    for (const uint32_t vertex : triangle.vertices) {
      ASSERT_GE(vertex, mesh->file_vertex_count);
      const glm::ivec3 q = mesh->vertices[vertex];
      const ClippedVertex& clipped = mesh->clipped[vertex - mesh->file_vertex_count];
      const glm::dvec3 p = clipped.weights[0] * a + clipped.weights[1] * b + clipped.weights[2] * c;
      for (int i = 0; i < 3; ++i) {
        EXPECT_GE(q[i], -256);
        EXPECT_LE(q[i], 9 * 256);
        EXPECT_NEAR((q[i] + 0.5) / 256, p[i], 1.0 / 256);
      }
    }
  }
}

TEST(Clip, neighbours_get_the_same_points_on_their_shared_side) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> uniform(-30.0, 40.0);
  const auto point = [&] { return glm::dvec3(uniform(random), uniform(random), uniform(random)); };
  size_t shared = 0;
  for (int t = 0; t < 2'000; ++t) {
    const glm::dvec3 a = point(), b = point(), c = point(), d = point();
    const ClipPolygon one = clip_triangle({a, b, c}, glm::dvec3(-1), glm::dvec3(9));
    const ClipPolygon other = clip_triangle({b, a, d}, glm::dvec3(-1), glm::dvec3(9));
    // Points without weight of the third corner lie on the shared side.
    std::vector<glm::dvec3> on_one, on_other;
    for (size_t i = 0; i < one.count; ++i) {
      if (one.corners[i].weights[2] == 0) on_one.push_back(one.corners[i].p_grid);
    }
    for (size_t i = 0; i < other.count; ++i) {
      if (other.corners[i].weights[2] == 0) on_other.push_back(other.corners[i].p_grid);
    }
    ASSERT_EQ(on_one.size(), on_other.size()) << t;
    shared += on_one.size();
    for (const glm::dvec3& p : on_one) {
      EXPECT_TRUE(std::find(on_other.begin(), on_other.end(), p) != on_other.end()) << t;
    }
  }
  EXPECT_GT(shared, 20u);
}

TEST(Clip, a_triangle_around_the_box_becomes_the_box) {
  const ClipPolygon polygon = clip_triangle(
      {glm::dvec3(-100, -100, 3), {300, -100, 3}, {-100, 300, 3}}, glm::dvec3(-1), glm::dvec3(9));
  ASSERT_EQ(polygon.count, 4u);
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_TRUE(polygon.corners[i].p_grid.x == -1 || polygon.corners[i].p_grid.x == 9);
    EXPECT_TRUE(polygon.corners[i].p_grid.y == -1 || polygon.corners[i].p_grid.y == 9);
  }
  EXPECT_EQ(
      clip_triangle({glm::dvec3(20), {21, 20, 20}, {20, 21, 20}}, glm::dvec3(-1), glm::dvec3(9))
          .count,
      0u);
}

// The same fan, whatever the order of the corners.
TEST(Clip, does_not_depend_on_the_order_of_corners) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> uniform(-30.0, 40.0);
  const auto point = [&] { return glm::dvec3(uniform(random), uniform(random), uniform(random)); };
  size_t fans = 0;
  for (int t = 0; t < 2'000; ++t) {
    const glm::dvec3 a = point(), b = point(), c = point();
    const auto clipped = [](const std::array<glm::dvec3, 3>& p) {
      return clip_triangle(p, glm::dvec3(-1), glm::dvec3(9));
    };
    const ClipPolygon expected = clipped({a, b, c});
    const size_t count = expected.count;
    fans += count > 3 ? 1 : 0;
    for (const ClipPolygon& turned : {clipped({b, c, a}), clipped({c, a, b})}) {
      ASSERT_EQ(turned.count, count) << t;
      for (size_t i = 0; i < count; ++i) {
        EXPECT_EQ(turned.corners[i].p_grid, expected.corners[i].p_grid) << t;
      }
    }
    const ClipPolygon reversed = clipped({c, b, a});
    ASSERT_EQ(reversed.count, count) << t;
    for (size_t i = 0; i < count; ++i) {
      EXPECT_EQ(reversed.corners[(count - i) % count].p_grid, expected.corners[i].p_grid) << t;
    }
  }
  EXPECT_GT(fans, 20u);
}

double extent_max(const SnappedMesh& mesh, const SnappedTriangle& triangle) {
  const glm::ivec3 &a = mesh.vertices[triangle.vertices[0]],
                   &b = mesh.vertices[triangle.vertices[1]],
                   &c = mesh.vertices[triangle.vertices[2]];
  const glm::ivec3 extent = glm::max(a, glm::max(b, c)) - glm::min(a, glm::min(b, c));
  return std::max({extent.x, extent.y, extent.z}) / 256.0;
}

// Twice the area of the projection to x and y, in voxels.
double area_xy(const SnappedMesh& mesh, const SnappedTriangle& triangle) {
  const glm::dvec3 a = mesh.vertices[triangle.vertices[0]], b = mesh.vertices[triangle.vertices[1]],
                   c = mesh.vertices[triangle.vertices[2]];
  return ((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)) / 65536;
}

TEST(Snap, splits_long_triangles_in_large_grids_and_nowhere_else) {
  const Scene scene = scene_of({{10, 10, 10}, {2040, 100, 10}, {10, 2030, 900}});
  const auto whole = snap_scene(scene, glm::dmat4(1.0), unit_spec(2048));
  ASSERT_TRUE(whole.ok());
  EXPECT_EQ(whole->triangles.size(), 1u);
  EXPECT_TRUE(whole->clipped.empty());
  const auto split = snap_scene(scene, glm::dmat4(1.0), unit_spec(2049));
  ASSERT_TRUE(split.ok());
  EXPECT_EQ(split->triangles.size(), 4u);
  double area = 0;
  for (const SnappedTriangle& triangle : split->triangles) {
    EXPECT_LE(extent_max(*split, triangle), kEdgeCellsMax + 1.0 / 256);
    area += area_xy(*split, triangle);
  }
  EXPECT_NEAR(area, area_xy(*whole, whole->triangles[0]), 100);
}

TEST(Snap, triangles_across_the_largest_grid_stay_in_reach_of_their_tiles) {
  const auto mesh = snap_scene(scene_of({{0, 0, 0},
                                         {16384, 3, 16384},
                                         {5, 16384, 700},
                                         {-9e5, 8000, 8000},
                                         {9e5, 8000, 8001},
                                         {8000, 9e5, 8000}}),
                               glm::dmat4(1.0), unit_spec(16384));
  ASSERT_TRUE(mesh.ok());
  EXPECT_GT(mesh->triangles.size(), 300u);
  for (const SnappedTriangle& triangle : mesh->triangles) {
    ASSERT_LE(extent_max(*mesh, triangle), kEdgeCellsMax + 1.0 / 256);
  }
  const auto refused = snap_scene(scene_of({{0, 0, 0}, {16384, 3, 16384}, {5, 16384, 700}}),
                                  glm::dmat4(1.0), unit_spec(16384), 5000);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kGridTooLarge);
}

// Each triangle reaches over the whole grid, whose sides cut it.
TEST(Snap, pieces_of_triangles_that_leave_the_grid_are_limited) {
  std::vector<glm::dvec3> corners;
  for (int t = 0; t < 100; ++t) {
    corners.insert(corners.end(), {{-9, -9, 4}, {30, -9, 4}, {-9, 30, 4}});
  }
  const Scene scene = scene_of(corners);
  const auto clipped = snap_scene(scene, glm::dmat4(1.0), unit_spec(8), 1'000'000);
  ASSERT_TRUE(clipped.ok());
  EXPECT_GE(clipped->triangles.size(), 200u);
  const auto refused = snap_scene(scene, glm::dmat4(1.0), unit_spec(8), 1000);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kGridTooLarge);
  EXPECT_EQ(refused.error().message(),
            "part \"\" has too many triangles that leave the grid or are as long as it: expected "
            "pieces of them in at most 1000 bytes, got more");
}

// Positions of the pieces' corners that have no weight of `corner`.
std::vector<glm::dvec3> on_side_against(size_t corner, const std::vector<SplitTriangle>& pieces) {
  std::vector<glm::dvec3> points;
  for (const SplitTriangle& piece : pieces) {
    for (const ClipCorner& c : piece) {
      if (c.weights[corner] == 0) points.push_back(c.p_grid);
    }
  }
  std::sort(points.begin(), points.end(), [](const glm::dvec3& a, const glm::dvec3& b) {
    return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
  });
  points.erase(std::unique(points.begin(), points.end()), points.end());
  return points;
}

SplitTriangle triangle_of(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  SplitTriangle t;
  t[0].p_grid = a, t[1].p_grid = b, t[2].p_grid = c;
  for (size_t i = 0; i < 3; ++i) t[i].weights[i] = 1;
  return t;
}

TEST(Split, neighbours_get_the_same_points_and_cover_the_same_area) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(0.0, 16384.0);
  const auto point = [&] { return glm::dvec3(uniform(random), uniform(random), uniform(random)); };
  const auto area = [](const SplitTriangle& t) {
    return glm::length(glm::cross(t[1].p_grid - t[0].p_grid, t[2].p_grid - t[0].p_grid));
  };
  for (int t = 0; t < 300; ++t) {
    const glm::dvec3 a = point(), b = point(), c = point(), d = a + (point() - a) * 0.1;
    std::vector<SplitTriangle> one, other;
    split_triangle(triangle_of(a, b, c), one);
    split_triangle(triangle_of(b, a, d), other);
    ASSERT_EQ(on_side_against(2, one), on_side_against(2, other)) << t;
    double sum = 0;
    for (const SplitTriangle& piece : one) {
      sum += area(piece);
      for (size_t e = 0; e < 3; ++e) {
        const glm::dvec3 side = glm::abs(piece[e].p_grid - piece[(e + 1) % 3].p_grid);
        ASSERT_LE(std::max({side.x, side.y, side.z}), kEdgeCellsMax);
      }
    }
    EXPECT_NEAR(sum / area(triangle_of(a, b, c)), 1.0, 1e-9);
  }
}

// The same pieces, whatever the order of the corners.
TEST(Split, does_not_depend_on_the_order_of_corners) {
  const glm::dvec3 a(0, 0, 0), b(9000, 200, 5), c(5100, 1200, 7000);
  const auto pieces = [](const SplitTriangle& t) {
    std::vector<SplitTriangle> made;
    split_triangle(t, made);
    std::vector<std::array<double, 9>> sorted;
    for (const SplitTriangle& piece : made) {
      std::array<std::array<double, 3>, 3> p{};
      for (size_t i = 0; i < 3; ++i)
        p[i] = {piece[i].p_grid.x, piece[i].p_grid.y, piece[i].p_grid.z};
      std::sort(p.begin(), p.end());
      sorted.push_back(
          {p[0][0], p[0][1], p[0][2], p[1][0], p[1][1], p[1][2], p[2][0], p[2][1], p[2][2]});
    }
    std::sort(sorted.begin(), sorted.end());
    return sorted;
  };
  const auto expected = pieces(triangle_of(a, b, c));
  EXPECT_GT(expected.size(), 16u);
  EXPECT_EQ(pieces(triangle_of(b, c, a)), expected);
  EXPECT_EQ(pieces(triangle_of(c, b, a)), expected);
  EXPECT_EQ(pieces(triangle_of(b, a, c)), expected);
}

bool equal(const SnappedMesh& a, const SnappedMesh& b) {
  return std::ranges::equal(a.vertices, b.vertices) && a.is_whole == b.is_whole &&
         a.part_first_vertex == b.part_first_vertex && a.clipped.size() == b.clipped.size() &&
         std::ranges::equal(a.triangles, b.triangles, [](const auto& s, const auto& t) {
           return s.vertices == t.vertices && s.part == t.part;
         });
}

// A mesh goes into the box, through a side of it, out of it and back again.
TEST(Snap, the_mesh_of_another_moment_does_not_show_in_this_one) {
  const Scene bind = scene_of({{1, 1, 1}, {3, 2, 1}, {2, 3, 4}, {4, 4, 4}, {5, 4, 4}, {5, 5, 5}});
  SnappedMesh before;
  const std::vector<double> shifts = {0, 1, 5, 6.5, 40, 5, 0.5, 0};
  const std::vector<bool> whole = {true, true, false, false, false, false, true, true};
  for (const int side : {8, 2049}) {
    for (size_t i = 0; i < shifts.size(); ++i) {
      Scene scene = bind;
      for (glm::dvec3& p : scene.parts[0].positions) p.x += shifts[i] - (side > 8 ? 1.5 : 0.0);
      const auto expected = snap_scene(scene, glm::dmat4(1.0), unit_spec(side));
      auto found =
          snap_scene(scene, glm::dmat4(1.0), unit_spec(side), INT64_MAX, std::move(before));
      ASSERT_TRUE(expected.ok() && found.ok());
      EXPECT_TRUE(equal(*found, *expected)) << side << " " << i;
      // Grids that split edges may have pieces of any triangle.
      EXPECT_EQ(found->is_whole, side == 8 && whole[i]) << side << " " << i;
      before = *std::move(found);
    }
    before = {};
  }
}

int points_of_snapping(const Scene& scene) {
  return test::points_passed(
      [&] { EXPECT_TRUE(snap_scene(scene, glm::dmat4(1.0), unit_spec(8)).ok()); });
}

// A copy of 2^20 triangles has 16 pieces of 1 MiB.
TEST(Snap, copies_of_many_triangles_pass_cancellation_points) {
  constexpr size_t kTriangles = size_t{1} << 20;
  Scene scene = scene_of({{1, 1, 1}, {2, 1, 1}, {1, 2, 1}});
  scene.parts[0].positions.emplace_back(20, 1, 1);
  const MeshPart one = scene.parts[0];
  std::vector<uint32_t>& indices = scene.parts[0].indices;
  while (indices.size() < 3 * kTriangles) {
    indices.push_back(static_cast<uint32_t>(indices.size() % 3));
  }
  const int alone = points_of_snapping(scene);

  Scene two = scene;
  two.parts.push_back(one);
  EXPECT_GE(points_of_snapping(two), alone + 16) << "the array grows";

  std::fill_n(indices.begin(), 3, 3u);  // misses the grid, so that those of other chunks move
  const size_t moved = kTriangles - kTriangles / static_cast<size_t>(voxel_threads());
  EXPECT_GE(points_of_snapping(scene), alone + static_cast<int>(moved / 65536));
}

// A copy of 2^21 vertices has 25 pieces of at most 1 MiB.
TEST(Snap, copies_of_many_vertices_pass_cancellation_points) {
  Scene scene = scene_of({{1, 1, 1}, {2, 1, 1}, {1, 2, 1}});
  scene.parts[0].positions.resize(size_t{1} << 21, glm::dvec3(20, 1, 1));
  auto mesh = snap_scene(scene, glm::dmat4(1.0), unit_spec(8));
  ASSERT_TRUE(mesh.ok());
  EXPECT_GE(test::points_passed([&] { settle_faces(glm::ivec3(8), false, *mesh); }), 25);
  EXPECT_EQ(mesh->clipped.size(), 3u);

  const int alone = points_of_snapping(scene);
  scene.parts[0].indices.insert(scene.parts[0].indices.end(), {0, 1, 3});
  EXPECT_GE(points_of_snapping(scene), alone + 25);
}

TEST(Snap, bounds_are_those_of_vertices_that_triangles_use) {
  Scene scene = scene_of({{1, 2, 3}, {4, 5, 6}, {2, 2, 2}});
  scene.parts[0].positions.emplace_back(100, 100, 100);
  glm::dmat4 twice(2.0);
  twice[3][3] = 1.0;
  const Box3d box = world_bounds(scene, twice);
  EXPECT_EQ(box.min, glm::dvec3(2, 4, 4));
  EXPECT_EQ(box.max, glm::dvec3(8, 10, 12));
  EXPECT_TRUE(world_bounds(Scene(), twice).empty());
}

}  // namespace
}  // namespace voxeld
