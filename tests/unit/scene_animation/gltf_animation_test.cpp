// glTF animations, against tests/reference and by hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include "server/scene/gltf/animation.h"
#include "tests/unit/scene/scene_test_util.h"
#include "tests/unit/scene_animation/animation_fixtures.h"

#include <algorithm>

namespace voxeld {
namespace {

using testing::ElementsAre;

TEST(GltfAnimation, frames_are_those_of_the_oracle) {
  const GltfBuilder builder = dancer();
  const AnimatedScene animated = loaded(builder);
  ASSERT_EQ(animated.animations.size(), 2u);
  for (const int animation : {0, 1}) {
    for (const double t : {0.0, 0.1, 0.25, 0.3, 0.5, 0.6, 0.7499, 1.0, 1.37, 1.9999, 2.0}) {
      SCOPED_TRACE(std::to_string(animation) + " at " + std::to_string(t));
      const double in_clip =
          std::min(t, animated.animations[static_cast<size_t>(animation)].duration_s);
      expect_frame(frame_of(animated, static_cast<size_t>(animation), t), animated.scene,
                   reference::gltf_frame(builder.json, {builder.bin}, animation, in_clip));
    }
  }
}

TEST(GltfAnimation, the_rest_pose_is_the_scene_as_it_is_loaded_without_motion) {
  const GltfBuilder builder = dancer();
  const AnimatedScene animated = loaded(builder);
  const auto still = builder.load();
  ASSERT_TRUE(still) << still.error().message();
  FrameVertices rest;
  ASSERT_TRUE(skin_vertices(animated.skin, animated.scene, animated.rig->rest(), rest));
  expect_frame(rest, animated.scene, reference::gltf_frame(builder.json, {builder.bin}, -1, 0));
  ASSERT_EQ(rest.parts.size(), still->parts.size());
  for (size_t p = 0; p < rest.parts.size(); ++p) {
    EXPECT_EQ(animated.scene.parts[p].indices, still->parts[p].indices);
    for (size_t v = 0; v < still->parts[p].positions.size(); ++v) {
      EXPECT_EQ(animated.scene.parts[p].positions[v], still->parts[p].positions[v]);
      EXPECT_LT(glm::distance(rest.parts[p].positions[v], still->parts[p].positions[v]), 1e-9);
    }
  }
}

TEST(GltfAnimation, has_names_and_durations) {
  const AnimatedScene animated = loaded(dancer());
  EXPECT_EQ(animated.animations[0].name, "spline");
  EXPECT_DOUBLE_EQ(animated.animations[0].duration_s, 2.0);
  EXPECT_EQ(animated.animations[0].frame_count, 0);
  EXPECT_EQ(animated.animations[1].name, "animation 1");
  EXPECT_DOUBLE_EQ(animated.animations[1].duration_s, 1.0);
  ASSERT_EQ(animated.joints.size(), 3u);
  EXPECT_EQ(animated.joints[2].name, "toe");
  EXPECT_EQ(animated.joints[2].parent, 1);
  EXPECT_EQ(animated.joints[0].parent, -1);
}

gltf::Keys keys_of(gltf::Interpolation interpolation, size_t width, std::vector<float> times,
                   std::vector<float> values) {
  return {interpolation, width, std::move(times), std::move(values)};
}

double number_at(const gltf::Keys& keys, double seconds) {
  double out = 0.0;
  gltf::sample_numbers(keys, seconds, {&out, 1});
  return out;
}

TEST(GltfKeys, steps_hold_and_lines_go_straight_and_both_end_at_their_ends) {
  const gltf::Keys step = keys_of(gltf::Interpolation::kStep, 1, {1, 2, 4}, {10, 20, 40});
  const gltf::Keys line = keys_of(gltf::Interpolation::kLinear, 1, {1, 2, 4}, {10, 20, 40});
  EXPECT_EQ(number_at(step, 0.0), 10);
  EXPECT_EQ(number_at(step, 1.999), 10);
  EXPECT_EQ(number_at(step, 2.0), 20);
  EXPECT_EQ(number_at(step, 9.0), 40);
  EXPECT_EQ(number_at(line, 0.0), 10);
  EXPECT_EQ(number_at(line, 1.5), 15);
  EXPECT_EQ(number_at(line, 3.5), 35);
  EXPECT_EQ(number_at(line, 9.0), 40);
}

TEST(GltfKeys, a_spline_follows_its_tangents) {
  // x^3 from 0 to 2 has the slopes 0 and 12; a cubic is what a Hermite spline is exact for.
  const gltf::Keys cube =
      keys_of(gltf::Interpolation::kCubicSpline, 1, {0, 2}, {9, 0, 0, 12, 8, 9});
  for (const double t : {0.0, 0.3, 1.0, 1.7, 2.0})
    EXPECT_NEAR(number_at(cube, t), t * t * t, 1e-12);
}

TEST(GltfKeys, times_that_repeat_jump) {
  const gltf::Keys line = keys_of(gltf::Interpolation::kLinear, 1, {0, 1, 1, 2}, {0, 1, 5, 6});
  EXPECT_NEAR(number_at(line, 0.999), 0.999, 1e-9);
  EXPECT_EQ(number_at(line, 1.0), 5);
  EXPECT_EQ(number_at(line, 1.5), 5.5);
}

TEST(GltfKeys, rotations_go_the_short_way_and_none_is_none) {
  // A turn by 0 and, with the other sign, by 90 degrees about z.
  const float h = std::sqrt(0.5f);
  const gltf::Keys turn =
      keys_of(gltf::Interpolation::kLinear, 4, {0, 1, 2}, {0, 0, 0, 1, 0, 0, -h, -h, 0, 0, 0, 0});
  std::array<double, 4> q{};
  gltf::sample_rotation(turn, 0.5, q);
  EXPECT_NEAR(std::abs(q[2]), std::sin(std::acos(-1) / 8), 1e-6);
  EXPECT_NEAR(std::abs(q[3]), std::cos(std::acos(-1) / 8), 1e-6);
  EXPECT_GT(q[2] * q[3], 0);
  gltf::sample_rotation(turn, 2.0, q);
  EXPECT_THAT(q, ElementsAre(0, 0, 0, 1));
}

TEST(GltfAnimation, unnormalized_weights_count_by_their_share) {
  GltfBuilder builder = dancer();
  const AnimatedScene animated = loaded(builder);
  for (size_t v = 0; v < animated.skin.vertex_count(); ++v) {
    double sum = 0.0;
    for (uint32_t i = animated.skin.first_influence[v]; i < animated.skin.first_influence[v + 1];
         ++i) {
      sum += animated.skin.influences[i].weight;
    }
    EXPECT_NEAR(sum, 1.0, 1e-12);
  }
}

TEST(GltfAnimation, a_vertex_bound_to_nothing_follows_the_node_of_its_mesh) {
  GltfBuilder builder = dancer();
  auto& attributes = builder.json["meshes"][0]["primitives"][0]["attributes"];
  attributes.erase("JOINTS_1");
  attributes.erase("WEIGHTS_1");
  attributes["WEIGHTS_0"] = builder.add_floats(std::vector<float>(24, 0.0f), "VEC4");
  const AnimatedScene animated = loaded(builder);
  expect_frame(frame_of(animated, 0, 1.2), animated.scene,
               reference::gltf_frame(builder.json, {builder.bin}, 0, 1.2));
}

TEST(GltfAnimation, normals_without_direction_are_those_of_a_face) {
  GltfBuilder builder = dancer();
  builder.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] =
      builder.add_floats(std::vector<float>(18, 0.0f), "VEC3");
  const AnimatedScene animated = loaded(builder);
  const FrameVertices frame = frame_of(animated, 1, 0.6);
  const auto& positions = frame.parts[0].positions;
  const auto& indices = animated.scene.parts[0].indices;
  const glm::dvec3 face = glm::normalize(glm::cross(positions[indices[1]] - positions[indices[0]],
                                                    positions[indices[2]] - positions[indices[0]]));
  EXPECT_LT(glm::distance(glm::dvec3(frame.parts[0].normals[indices[0]]), face), 1e-6);
}

TEST(GltfAnimation, mirrored_parts_keep_their_corners_and_their_side) {
  GltfBuilder builder = dancer();
  builder.json["nodes"][5]["scale"] = {-1, 2, 3};
  const AnimatedScene animated = loaded(builder);
  // Rest and frame both by the mirroring scale: the animation moves weights alone.
  const FrameVertices frame = frame_of(animated, 0, 0.0);
  const MeshPart& face = animated.scene.parts[1];
  const auto& p = frame.parts[1].positions;
  const glm::dvec3 n =
      glm::cross(p[face.indices[1]] - p[face.indices[0]], p[face.indices[2]] - p[face.indices[0]]);
  EXPECT_GT(glm::dot(n, glm::dvec3(frame.parts[1].normals[0])), 0.0);
}

TEST(GltfAnimation, channels_without_a_usable_target_are_ignored_with_a_warning) {
  GltfBuilder builder = dancer();
  auto& channels = builder.json["animations"][0]["channels"];
  channels.push_back(Json::parse(R"({"sampler": 0, "target": {"path": "translation"}})"));
  channels.push_back(Json::parse(R"({"sampler": 0, "target": {"node": 2, "path": "pointer"}})"));
  channels.push_back(Json::parse(R"({"sampler": 2, "target": {"node": 6, "path": "weights"}})"));
  const AnimatedScene animated = loaded(builder);
  EXPECT_THAT(
      warnings(animated.scene),
      ElementsAre("ignored-channel: a.gltf animations[0].channels[3]: names no node",
                  "ignored-channel: a.gltf animations[0].channels[4]: the path \"pointer\" is not "
                  "read",
                  "ignored-channel: a.gltf animations[0].channels[5]: its node shows no morph "
                  "targets"));
}

}  // namespace
}  // namespace voxeld
