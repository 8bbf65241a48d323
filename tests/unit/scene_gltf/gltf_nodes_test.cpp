// Placement of meshes: node transforms, scenes, instances, skins.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/unit/scene_gltf/gltf_builder.h"

namespace voxeld {
namespace {

using ::testing::ElementsAre;

void expect_near(const glm::dvec3& got, const glm::dvec3& expected) {
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(got[i], expected[i], 1e-12) << "component " << i;
}

TEST(GltfNodes, scale_rotation_translation_in_this_order) {
  GltfBuilder builder = triangle();
  const double h = std::sqrt(0.5);
  builder.json["nodes"][0]["translation"] = {10, 20, 30};
  builder.json["nodes"][0]["rotation"] = {0, 0, h, h};  // 90 degrees about z
  builder.json["nodes"][0]["scale"] = {2, 3, 4};
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  expect_near(scene->parts[0].positions[1], {10, 22, 30});
  expect_near(scene->parts[0].positions[2], {7, 20, 30});
}

TEST(GltfNodes, matrices_are_by_columns_and_multiply_down_the_tree) {
  GltfBuilder builder = triangle();
  builder.json["nodes"] = Json::parse(R"([
    {"children": [1], "matrix": [2,0,0,0, 0,2,0,0, 0,0,2,0, 1,2,3,1]},
    {"mesh": 0, "translation": [10, 0, 0], "name": "leaf"}])");
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(scene->parts[0].positions[1], glm::dvec3(23, 2, 3));
  EXPECT_EQ(scene->parts[0].name, "leaf");
}

TEST(GltfNodes, a_mesh_of_two_nodes_stands_in_two_places) {
  GltfBuilder builder = triangle();
  builder.json["nodes"] = Json::parse(R"([{"mesh": 0}, {"mesh": 0, "translation": [5, 0, 0]}])");
  builder.json["scenes"][0]["nodes"] = {0, 1};
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  ASSERT_EQ(scene->parts.size(), 2u);
  EXPECT_EQ(scene->parts[1].positions[0], glm::dvec3(5, 0, 0));
}

TEST(GltfNodes, a_long_name_costs_each_part_little) {
  GltfBuilder builder = triangle();
  const std::string name(5000, 'x');
  builder.json["meshes"][0]["name"] = name;
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(scene->parts[0].name, name.substr(0, 1024));
  EXPECT_THAT(scene->meshes, ElementsAre(name));
  EXPECT_THAT(scene->groups, ElementsAre(name.substr(0, 1024) + "/0"));
}

TEST(GltfNodes, parts_know_their_mesh_their_node_and_their_primitive) {
  GltfBuilder builder = triangle();
  Json& primitives = builder.json["meshes"][0]["primitives"];
  const Json primitive = primitives[0];
  primitives.push_back(primitive);
  builder.json["meshes"][0]["name"] = "wheel";
  Json unnamed = Json::object();
  unnamed["primitives"] = Json::array({primitive});
  builder.json["meshes"].push_back(unnamed);
  builder.json["nodes"] = Json::parse(
      R"([{"mesh": 1}, {"mesh": 0, "name": "left"}, {"mesh": 0, "name": "right"},
          {"name": "left"}])");
  builder.json["scenes"][0]["nodes"] = {2, 1, 0};
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  std::vector<std::string> origins;
  for (const MeshPart& part : scene->parts) {
    origins.push_back(scene->meshes.at(part.mesh) + " | " + scene->nodes.at(part.node) + " | " +
                      scene->groups.at(part.group));
  }
  std::ranges::sort(origins);
  EXPECT_THAT(origins, ElementsAre("meshes[1] | nodes[0] | meshes[1]/0", "wheel | left | wheel/0",
                                   "wheel | left | wheel/1", "wheel | right | wheel/0",
                                   "wheel | right | wheel/1"));
  EXPECT_EQ(scene->meshes.size(), 2u);
  EXPECT_EQ(scene->nodes.size(), 3u);
  EXPECT_EQ(scene->groups.size(), 3u);
  EXPECT_EQ(scene->parts[0].node, 0u) << "as surfaces first use them";
}

TEST(GltfNodes, mirroring_turns_triangles_and_normals) {
  GltfBuilder builder = triangle();
  builder.attributes()["NORMAL"] = builder.add_floats({0, 0, 1, 0, 0, 1, 1, 0, 1}, "VEC3");
  builder.json["nodes"][0]["scale"] = {-1, 1, 1};
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_THAT(scene->parts[0].indices, ElementsAre(0, 2, 1));
  EXPECT_EQ(scene->parts[0].normals[0], glm::vec3(0, 0, 1));
  EXPECT_LT(scene->parts[0].normals[2].x, 0);
}

TEST(GltfNodes, normals_go_by_the_inverse_transpose) {
  GltfBuilder builder = triangle();
  builder.attributes()["NORMAL"] = builder.add_floats({1, 1, 0, 1, 1, 0, 1, 1, 0}, "VEC3");
  builder.json["nodes"][0]["scale"] = {1, 2, 1};
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_NEAR(scene->parts[0].normals[0].x / scene->parts[0].normals[0].y, 2, 1e-6);
}

TEST(GltfNodes, the_default_scene_is_shown_else_the_first_else_all_roots) {
  GltfBuilder builder = triangle();
  builder.json["nodes"] = Json::parse(
      R"([{"mesh": 0}, {"mesh": 0, "translation": [1, 0, 0]},
          {"mesh": 0, "translation": [2, 0, 0]}])");
  builder.json["scenes"] = Json::parse(R"([{"nodes": [1]}, {"nodes": [2]}])");
  builder.json["scene"] = 1;
  EXPECT_EQ(builder.load()->parts.at(0).positions[0].x, 2);
  builder.json.erase("scene");
  EXPECT_EQ(builder.load()->parts.at(0).positions[0].x, 1);
  EXPECT_EQ(builder.load()->parts.size(), 1u);
  builder.json.erase("scenes");
  EXPECT_EQ(builder.load()->parts.size(), 3u);
}

TEST(GltfNodes, a_skinned_mesh_stands_where_its_joints_are) {
  GltfBuilder builder = triangle();
  builder.attributes()["JOINTS_0"] = builder.add_u16({0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0}, "VEC4");
  builder.attributes()["WEIGHTS_0"] =
      builder.add_floats({1, 0, 0, 0, 0.5f, 0.5f, 0, 0, 1, 0, 0, 0}, "VEC4");
  // Inverse bind matrices: the first moves by -1 along x, the second by none.
  builder.json["skins"] = Json::array({Json{
      {"joints", {1, 2}},
      {"inverseBindMatrices", builder.add_floats({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 1,
                                                  1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0,  0, 0, 1},
                                                 "MAT4")}}});
  builder.json["nodes"] = Json::parse(R"([
    {"mesh": 0, "skin": 0, "translation": [1000, 0, 0]},
    {"translation": [1, 0, 5]},
    {"translation": [0, 0, 7]}])");
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(scene->parts[0].positions[0], glm::dvec3(0, 0, 5));
  EXPECT_EQ(scene->parts[0].positions[1], glm::dvec3(1, 0, 6));
  EXPECT_EQ(scene->parts[0].positions[2], glm::dvec3(0, 1, 7));
}

TEST(GltfNodes, ignored_animations_are_warnings) {
  GltfBuilder builder = triangle();
  builder.json["animations"] = Json::array({Json::object()});
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_THAT(warnings(*scene), ElementsAre("static-pose: a.gltf: animations are left out; the "
                                            "mesh has the file's own pose"));
}

}  // namespace
}  // namespace voxeld
