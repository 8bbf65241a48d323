#include "server/worker/mesh_topology.h"

#include <gtest/gtest.h>

#include <limits>
#include <utility>
#include <vector>

namespace voxeld {
namespace {

MeshPart part(std::vector<glm::dvec3> positions, std::vector<uint32_t> indices) {
  MeshPart part;
  part.positions = std::move(positions);
  part.indices = std::move(indices);
  return part;
}

Scene scene_of(std::vector<MeshPart> parts) {
  Scene scene;
  scene.parts = std::move(parts);
  return scene;
}

const std::vector<glm::dvec3> kCorners = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
const std::vector<uint32_t> kTetrahedron = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};

TEST(MeshTopology, a_tetrahedron_is_watertight) {
  const auto topology = mesh_topology(scene_of({part(kCorners, kTetrahedron)}));
  ASSERT_TRUE(topology);
  EXPECT_TRUE(topology->watertight());
  EXPECT_EQ(topology->distinct_positions, 4);
  EXPECT_EQ(topology->flipped_edges, 0);
}

TEST(MeshTopology, a_missing_face_leaves_three_open_edges) {
  const auto topology = mesh_topology(scene_of({part(kCorners, {0, 2, 1, 0, 1, 3, 1, 2, 3})}));
  EXPECT_EQ(topology->open_edges, 3);
  EXPECT_FALSE(topology->watertight());
}

TEST(MeshTopology, faces_with_vertices_of_their_own_and_in_other_parts_are_one_surface) {
  std::vector<MeshPart> parts;
  for (size_t face = 0; face < 4; ++face) {
    std::vector<glm::dvec3> corners;
    for (size_t i = 0; i < 3; ++i) corners.push_back(kCorners[kTetrahedron[3 * face + i]]);
    parts.push_back(part(corners, {0, 1, 2}));
  }
  parts[0].positions[0].x = -0.0;  // the same point as 0.0
  const auto topology = mesh_topology(scene_of(parts));
  EXPECT_EQ(topology->distinct_positions, 4);
  EXPECT_TRUE(topology->watertight());
}

TEST(MeshTopology, positions_that_differ_in_the_last_bit_are_two) {
  auto corners = kCorners;
  corners.push_back({std::numeric_limits<double>::denorm_min(), 0, 0});
  auto indices = kTetrahedron;
  indices.back() = 3;
  indices[0] = 4;  // the first face uses the other point
  EXPECT_EQ(mesh_topology(scene_of({part(corners, indices)}))->open_edges, 4);
}

TEST(MeshTopology, a_third_face_on_an_edge_is_non_manifold) {
  auto corners = kCorners;
  corners.push_back({-1, -1, -1});
  auto indices = kTetrahedron;
  indices.insert(indices.end(), {0, 1, 4});
  const auto topology = mesh_topology(scene_of({part(corners, indices)}));
  EXPECT_EQ(topology->non_manifold_edges, 1);
  EXPECT_EQ(topology->open_edges, 2);
}

TEST(MeshTopology, a_face_that_is_turned_round_shows_in_flipped_edges) {
  auto indices = kTetrahedron;
  std::swap(indices[0], indices[1]);
  const auto topology = mesh_topology(scene_of({part(kCorners, indices)}));
  EXPECT_EQ(topology->flipped_edges, 3);
  EXPECT_TRUE(topology->watertight());
}

TEST(MeshTopology, triangles_without_area_by_their_vertices_are_left_out) {
  auto indices = kTetrahedron;
  indices.insert(indices.end(), {0, 0, 1, 2, 2, 2});
  const auto topology = mesh_topology(scene_of({part(kCorners, indices)}));
  EXPECT_EQ(topology->degenerate_triangles, 2);
  EXPECT_TRUE(topology->watertight());
}

TEST(MeshTopology, a_scene_without_triangles_has_no_edges) {
  const auto topology = mesh_topology(Scene{});
  ASSERT_TRUE(topology);
  EXPECT_EQ(topology->open_edges, 0);
}

}  // namespace
}  // namespace voxeld
