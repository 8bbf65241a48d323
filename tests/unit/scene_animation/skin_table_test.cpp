// Skinning over the flat table, on tables made by hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>

#include "server/base/cancel_point.h"
#include "server/scene/core/skin_table.h"
#include "tests/unit/base/points_passed.h"
#include "tests/unit/scene/scene_test_util.h"

namespace voxeld {
namespace {

using testing::ElementsAre;

// `count` vertices in parts of 1000, each of two influences.
struct LongRow {
  Scene scene;
  SkinTable table;
  explicit LongRow(size_t count) {
    std::vector<SkinPart> parts;
    for (size_t v = 0; v < count; ++v) {
      if (v % 1000 == 0) {
        parts.emplace_back();
        scene.parts.emplace_back();
      }
      SkinPart& part = parts.back();
      part.points.emplace_back(static_cast<double>(v), 1.0, 2.0);
      part.normals.emplace_back(0, 1, 0);
      part.influences.push_back({0, 0.25});
      part.influences.push_back({1, 0.75});
      part.end_vertex();
      scene.parts.back().positions.emplace_back(0.0);
      scene.parts.back().normals.emplace_back(0, 1, 0);
    }
    table = join_skin_parts(std::move(parts), false);
  }
};

TEST(SkinTable, parts_stand_one_after_another) {
  std::vector<SkinPart> parts(3);
  parts[0].points = {{1, 0, 0}, {2, 0, 0}};
  parts[0].normals.resize(2);
  parts[0].influences = {{0, 1.0}};
  parts[0].end_vertex();
  parts[0].influences.push_back({1, 0.5});
  parts[0].influences.push_back({2, 0.5});
  parts[0].end_vertex();
  parts[2].points = {{3, 0, 0}};
  parts[2].normals.resize(1);
  parts[2].influences = {{3, 1.0}};
  parts[2].morphs = {{7, {1, 0, 0}, {}}};
  parts[2].end_vertex();
  const SkinTable table = join_skin_parts(std::move(parts), false);
  EXPECT_THAT(table.part_first_vertex, ElementsAre(0, 2, 2, 3));
  EXPECT_THAT(table.first_influence, ElementsAre(0, 1, 3, 4));
  EXPECT_THAT(table.first_morph, ElementsAre(0, 0, 0, 1));
  EXPECT_EQ(table.influences[3].matrix, 3u);
  EXPECT_EQ(table.points[2].x, 3.0);
  EXPECT_EQ(table.vertex_count(), 3u);
}

TEST(SkinTable, joining_parts_can_be_cancelled) {
  std::vector<SkinPart> parts(2);
  for (SkinPart& part : parts) part.influences.resize(100'000);
  const auto join = [&] { (void)join_skin_parts(std::move(parts), true); };
  EXPECT_GE(test::points_passed(join), 100'000 / 4096);
}

// So many that threads share them; every vertex is where it would be alone.
TEST(SkinTable, many_vertices_are_skinned_as_few) {
  const LongRow row(50'500);
  Pose pose;
  pose.world_from_bound = {glm::dmat4(1.0), glm::translate(glm::dmat4(1.0), {0.0, 4.0, 8.0})};
  FrameVertices frame;
  ASSERT_TRUE(skin_vertices(row.table, row.scene, pose, frame));
  ASSERT_EQ(frame.parts.size(), 51u);
  EXPECT_EQ(frame.parts[50].positions.size(), 500u);
  for (size_t p = 0; p < frame.parts.size(); ++p) {
    for (size_t v = 0; v < frame.parts[p].positions.size(); ++v) {
      ASSERT_EQ(frame.parts[p].positions[v],
                glm::dvec3(1000.0 * static_cast<double>(p) + static_cast<double>(v), 4.0, 8.0));
      ASSERT_EQ(frame.parts[p].normals[v], glm::vec3(0, 1, 0));
    }
  }
}

TEST(SkinTable, the_memory_of_a_frame_is_used_again) {
  const LongRow row(10);
  Pose pose;
  pose.world_from_bound.assign(2, glm::dmat4(1.0));
  FrameVertices frame;
  ASSERT_TRUE(skin_vertices(row.table, row.scene, pose, frame));
  const glm::dvec3* before = frame.parts[0].positions.data();
  ASSERT_TRUE(skin_vertices(row.table, row.scene, pose, frame));
  EXPECT_EQ(frame.parts[0].positions.data(), before);
}

TEST(SkinTable, each_vertex_can_be_cancelled) {
  const LongRow row(10);
  Pose pose;
  pose.world_from_bound.assign(2, glm::dmat4(1.0));
  FrameVertices frame;
  const std::atomic<bool> flag{true};
  const CancelScope scope(flag);
  EXPECT_THROW((void)skin_vertices(row.table, row.scene, pose, frame).ok(), Cancelled);
}

TEST(SkinTable, an_invalid_position_is_reported_with_part_and_vertex) {
  LongRow row(2'100);
  row.scene.parts[2].name = "tail";
  row.table.points[2'050].x = 1e300;
  Pose pose;
  pose.world_from_bound.assign(2, glm::dmat4(1.0));
  FrameVertices frame;
  const Status status = skin_vertices(row.table, row.scene, pose, frame);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kMalformedMesh);
  EXPECT_EQ(status.error().message(),
            "the animation part 2: vertex 50 of \"tail\" gets to no finite place: expected "
            "coordinates of at most 1e30 in size");
}

TEST(SkinTable, points_of_influences_are_moved_each_by_its_matrix) {
  SkinPart part;
  part.points = {{1, 0, 0}, {0, 2, 0}};
  part.normals = {{0, 0, 1}, {0, 0, 1}};
  part.influences = {{0, 0.5}, {1, 0.5}};
  part.end_vertex();
  Scene scene;
  scene.parts.resize(1);
  scene.parts[0].positions.resize(1);
  scene.parts[0].normals.resize(1);
  Pose pose;
  pose.world_from_bound = {glm::translate(glm::dmat4(1.0), {10.0, 0.0, 0.0}),
                           glm::rotate(glm::dmat4(1.0), std::acos(0.0), {1.0, 0.0, 0.0})};
  FrameVertices frame;
  const SkinTable table = join_skin_parts({part}, true);
  ASSERT_TRUE(skin_vertices(table, scene, pose, frame));
  EXPECT_LT(glm::distance(frame.parts[0].positions[0], glm::dvec3(5.5, 0, 1)), 1e-12);
  const glm::vec3 half = glm::normalize(glm::vec3(0, -1, 1));
  EXPECT_LT(glm::distance(frame.parts[0].normals[0], half), 1e-6f);
}

}  // namespace
}  // namespace voxeld
