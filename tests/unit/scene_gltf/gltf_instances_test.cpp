// EXT_mesh_gpu_instancing: copies of a node's mesh.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/scene/core/animated_scene.h"
#include "server/scene/core/loaders.h"
#include "tests/unit/scene_gltf/gltf_builder.h"

namespace voxeld {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

void expect_at(const glm::dvec3& got, const glm::dvec3& expected) {
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(got[i], expected[i], 1e-6) << "component " << i;
}

// A triangle and copies of it; the attributes are to be added.
GltfBuilder copied_triangle() {
  GltfBuilder builder = triangle();
  builder.json["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  builder.json["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
  builder.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = Json::object();
  return builder;
}

Json& copies(GltfBuilder& builder) {
  return builder.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
}

TEST(GltfInstances, copies_are_scaled_rotated_and_moved_in_the_frame_of_the_node) {
  GltfBuilder builder = copied_triangle();
  const auto h = static_cast<float>(std::sqrt(0.5));
  copies(builder)["TRANSLATION"] = builder.add_floats({0, 0, 0, 5, 0, 0}, "VEC3");
  copies(builder)["ROTATION"] = builder.add_floats({0, 0, 0, 1, 0, 0, h, h}, "VEC4");
  copies(builder)["SCALE"] = builder.add_floats({1, 1, 1, 2, 3, 1}, "VEC3");
  builder.json["nodes"][0]["translation"] = {0, 0, 10};
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_THAT(warnings(*scene), IsEmpty());
  ASSERT_EQ(scene->parts.size(), 1u);  // of one node
  const MeshPart& part = scene->parts[0];
  ASSERT_EQ(part.positions.size(), 6u);
  expect_at(part.positions[1], {1, 0, 10});
  expect_at(part.positions[3], {5, 0, 10});
  expect_at(part.positions[4], {5, 2, 10});
  expect_at(part.positions[5], {2, 0, 10});
}

TEST(GltfInstances, a_mirrored_copy_keeps_the_front_of_its_triangles) {
  GltfBuilder builder = copied_triangle();
  copies(builder)["SCALE"] = builder.add_floats({1, 1, 1, -1, 1, 1}, "VEC3");
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(scene->parts[0].indices, (std::vector<uint32_t>{0, 1, 2, 3, 5, 4}));
}

TEST(GltfInstances, colours_of_copies_are_multiplied_with_those_of_the_mesh) {
  GltfBuilder builder = copied_triangle();
  copies(builder)["_COLOR_0"] = builder.add_floats({1, 0.5f, 0, 0, 0, 1}, "VEC3");
  EXPECT_EQ(builder.load()->parts[0].colors[4], glm::vec4(0, 0, 1, 1));
  builder.attributes()["COLOR_0"] =
      builder.add_floats({0.5f, 0.5f, 0.5f, 1, 1, 1, 1, 1, 1}, "VEC3");
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(scene->parts[0].colors[0], glm::vec4(0.5f, 0.25f, 0, 1));
  EXPECT_EQ(scene->parts[0].colors[3], glm::vec4(0, 0, 0.5f, 1));
}

TEST(GltfInstances, rotations_may_be_small_integers) {
  GltfBuilder builder = copied_triangle();
  const int rotation = builder.add_accessor({0, 0, 127, 0}, 5120, "VEC4", 1);
  builder.json["accessors"][rotation]["normalized"] = true;
  copies(builder)["ROTATION"] = rotation;
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  expect_at(scene->parts[0].positions[1], {-1, 0, 0});
}

TEST(GltfInstances, copies_follow_the_animation_of_their_node) {
  GltfBuilder builder = copied_triangle();
  copies(builder)["TRANSLATION"] = builder.add_floats({0, 0, 0, 5, 0, 0}, "VEC3");
  const int times = builder.add_floats({0, 1}, "SCALAR");
  const int values = builder.add_floats({0, 0, 0, 0, 7, 0}, "VEC3");
  builder.json["animations"] = Json::array(
      {Json{{"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}},
            {"samplers", {{{"input", times}, {"output", values}}}}}});
  const Bytes glb = builder.glb();
  const FakeBundle none;
  const auto animated = load_animated_gltf("a.glb", glb, none, {});
  ASSERT_TRUE(animated) << animated.error().message();
  const Pose pose = animated->rig->at(0, 1.0);
  ASSERT_EQ(pose.world_from_bound.size(), 2u);
  expect_at(glm::dvec3(pose.world_from_bound[0][3]), {0, 7, 0});
  expect_at(glm::dvec3(pose.world_from_bound[1][3]), {5, 7, 0});
}

TEST(GltfInstances, a_mesh_with_a_skin_is_there_once_with_a_warning) {
  GltfBuilder builder = copied_triangle();
  copies(builder)["TRANSLATION"] = builder.add_floats({0, 0, 0, 5, 0, 0}, "VEC3");
  builder.attributes()["JOINTS_0"] = builder.add_u16(std::vector<uint16_t>(12, 0), "VEC4");
  builder.attributes()["WEIGHTS_0"] = builder.add_floats(std::vector<float>(12, 0.25f), "VEC4");
  builder.json["skins"] = Json::array({Json{{"joints", {0}}}});
  builder.json["nodes"][0]["skin"] = 0;
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(scene->triangle_count(), 1u);
  EXPECT_THAT(warnings(*scene),
              ElementsAre("ignored-extension: a.gltf nodes[0]: EXT_mesh_gpu_instancing of a mesh "
                          "with a skin is left out: there is one"));
}

TEST(GltfInstances, no_copy_is_no_triangle) {
  GltfBuilder builder = copied_triangle();
  copies(builder)["TRANSLATION"] = builder.json["accessors"].size();
  builder.json["accessors"].push_back(
      Json{{"componentType", 5126}, {"count", 0}, {"type", "VEC3"}});
  EXPECT_THAT(outcome(builder.load()), HasSubstr("empty-mesh"));
}

TEST(GltfInstances, errors_name_the_node) {
  const std::string where =
      "malformed-mesh: a.gltf nodes[0].extensions.EXT_mesh_gpu_instancing.attributes";
  GltfBuilder builder = copied_triangle();
  EXPECT_EQ(outcome(builder.load()),
            where + ": no attribute of copies: expected TRANSLATION, ROTATION or SCALE, got none");
  copies(builder)["TRANSLATION"] = builder.add_floats({0, 0, 0, 5, 0, 0}, "VEC3");
  copies(builder)["SCALE"] = builder.add_floats({1, 1, 1}, "VEC3");
  EXPECT_EQ(outcome(builder.load()),
            where + ".SCALE: elements of the attribute: expected 2 as others, got 1");
  builder = copied_triangle();
  copies(builder)["TRANSLATION"] = builder.json["accessors"].size();
  builder.json["accessors"].push_back(
      Json{{"componentType", 5126}, {"count", 1048577}, {"type", "VEC3"}});
  EXPECT_EQ(outcome(builder.load()),
            where + ": copies of a mesh: expected at most 1048576, got 1048577");
  // Many nodes share the limit, and the triangles of all copies that of a scene.
  const Json node = builder.json["nodes"][0];
  builder.json["accessors"].back()["count"] = 1048575;
  copies(builder)["TRANSLATION"] = builder.add_floats({0, 0, 0, 5, 0, 0}, "VEC3");
  builder.json["nodes"].push_back(node);
  builder.json["scenes"][0]["nodes"] = {0, 1};
  EXPECT_EQ(outcome(builder.load()),
            "malformed-mesh: a.gltf nodes[1]: copies of the meshes of all nodes: expected at most "
            "1048576, got 1048577");
}

TEST(GltfInstances, the_triangles_of_all_copies_count) {
  GltfBuilder builder = copied_triangle();
  copies(builder)["TRANSLATION"] = builder.json["accessors"].size();
  builder.json["accessors"].push_back(
      Json{{"componentType", 5126}, {"count", 40'000}, {"type", "VEC3"}});
  std::vector<uint16_t> corners(3 * 25'001);
  builder.primitive()["indices"] = builder.add_u16(corners);
  EXPECT_THAT(outcome(builder.load()), HasSubstr("triangles of the scene: expected at most"));
}

}  // namespace
}  // namespace voxeld
