#include "server/worker/mesh/mesh_topology.h"

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

// The tetrahedron, larger and moved; turned inside out where the scale is negative.
MeshPart tetrahedron(double scale, const glm::dvec3& at) {
  auto corners = kCorners;
  for (glm::dvec3& corner : corners) corner = corner * scale + at;
  return part(corners, kTetrahedron);
}

TEST(MeshTopology, parts_that_share_no_position_are_components) {
  const auto apart = mesh_topology(scene_of({tetrahedron(1, {}), tetrahedron(1, {5, 0, 0})}));
  EXPECT_EQ(apart->components, 2);
  EXPECT_EQ(apart->enclosed_components, 0);
  EXPECT_EQ(mesh_topology(scene_of({part(kCorners, kTetrahedron)}))->components, 1);
}

TEST(MeshTopology, a_solid_in_a_solid_is_an_inner_wall_and_a_cavity_is_not) {
  const MeshPart outer = tetrahedron(10, {0, 0, 0});
  const auto walls = mesh_topology(scene_of({tetrahedron(1, {1, 1, 1}), outer}));
  EXPECT_EQ(walls->enclosed_components, 1);
  EXPECT_EQ(walls->inner_walls, 1);
  // A negative scale is a point reflection: it turns the faces inwards.
  const auto cavity = mesh_topology(scene_of({outer, tetrahedron(-1, {2, 2, 2})}));
  EXPECT_EQ(cavity->enclosed_components, 1);
  EXPECT_EQ(cavity->inner_walls, 0);
  // In the box of the outer one, but beside its slanted face.
  const auto beside = mesh_topology(scene_of({outer, tetrahedron(1, {7, 7, 7})}));
  EXPECT_EQ(beside->enclosed_components, 0);
  // An open one encloses nothing, and an enclosed open one is no wall.
  MeshPart open = tetrahedron(1, {1, 1, 1});
  open.indices.resize(9);
  EXPECT_EQ(mesh_topology(scene_of({outer, open}))->enclosed_components, 1);
  EXPECT_EQ(mesh_topology(scene_of({outer, open}))->inner_walls, 0);
  MeshPart open_outer = outer;
  open_outer.indices.resize(9);
  EXPECT_EQ(mesh_topology(scene_of({open_outer, open}))->enclosed_components, 0);
}

TEST(MeshTopology, closed_means_that_edges_cancel_out) {
  const auto closed = mesh_topology(scene_of({part(kCorners, kTetrahedron)}));
  EXPECT_TRUE(closed->closed());
  auto indices = kTetrahedron;
  std::swap(indices[0], indices[1]);
  EXPECT_EQ(mesh_topology(scene_of({part(kCorners, indices)}))->unbalanced_edges, 3);
  // Four faces on an edge cancel out, two by two.
  auto corners = kCorners;
  corners.push_back({-1, 0, 0});
  corners.push_back({0, -1, 0});
  auto twice = kTetrahedron;
  for (const uint32_t i : kTetrahedron) twice.push_back(i == 1 ? 4 : i == 2 ? 5 : i);
  const auto joined = mesh_topology(scene_of({part(corners, twice)}));
  EXPECT_EQ(joined->non_manifold_edges, 1);
  EXPECT_TRUE(joined->closed());
}

TEST(MeshTopology, a_scene_without_triangles_has_no_edges) {
  const auto topology = mesh_topology(Scene{});
  ASSERT_TRUE(topology);
  EXPECT_EQ(topology->open_edges, 0);
}

}  // namespace
}  // namespace voxeld
