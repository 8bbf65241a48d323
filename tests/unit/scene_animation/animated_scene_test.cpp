// Times, names, boxes and root motion of animated scenes, whatever their format.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "server/scene/load.h"
#include "tests/unit/scene/scene_test_util.h"
#include "tests/unit/scene_animation/animation_fixtures.h"

namespace voxeld {
namespace {

using test::message_of;

glm::dvec3 lamp_at(const AnimatedScene& puppet, double seconds, Repeat repeat) {
  const auto frame = scene_at(puppet, 1, seconds, repeat);
  EXPECT_TRUE(frame.ok());
  return frame->parts[1].positions[0];
}

TEST(AnimatedScene, times_beyond_the_ends_are_the_ends_or_further_rounds) {
  const AnimatedScene puppet = loaded("puppet.zip", puppet_zip());
  const double duration = puppet.animations[1].duration_s;
  const auto clamped = [&](double t) { return lamp_at(puppet, t, Repeat::kClamp); };
  const auto looped = [&](double t) { return lamp_at(puppet, t, Repeat::kLoop); };
  EXPECT_EQ(clamped(-1), clamped(0));
  EXPECT_EQ(clamped(99), clamped(duration));
  EXPECT_EQ(clamped(std::nan("")), clamped(0));
  EXPECT_EQ(clamped(std::numeric_limits<double>::infinity()), clamped(duration));
  EXPECT_LT(glm::distance(looped(2.25 * duration), clamped(0.25 * duration)), 1e-9);
  EXPECT_LT(glm::distance(looped(-0.25 * duration), clamped(0.75 * duration)), 1e-9);
  EXPECT_NE(clamped(0), clamped(duration));
}

TEST(AnimatedScene, animations_are_found_by_name_then_by_number) {
  AnimatedScene puppet = loaded("puppet.zip", puppet_zip());
  EXPECT_EQ(find_animation(puppet, "wave").value(), 1u);
  EXPECT_EQ(find_animation(puppet, "0").value(), 0u);
  EXPECT_EQ(message_of(find_animation(puppet, "2")),
            "animation: there is none of this name or number: expected \"walk\", \"wave\", or 0 to "
            "1, got \"2\"");
  EXPECT_EQ(message_of(find_animation(puppet, "")),
            "animation: there is none of this name or number: expected \"walk\", \"wave\", or 0 to "
            "1, got \"\"");
  puppet.animations[1].name = "0";
  EXPECT_EQ(find_animation(puppet, "0").value(), 1u);
  EXPECT_EQ(find_animation(puppet, "1").value(), 1u);
}

TEST(AnimatedScene, frames_are_exchanged_with_the_scene_without_copies) {
  AnimatedScene puppet = loaded("puppet.zip", puppet_zip());
  auto frame = scene_at(puppet, 0, 0.2);
  ASSERT_TRUE(frame.ok());
  const glm::dvec3* moved = frame->parts[0].positions.data();
  const glm::dvec3* still = puppet.scene.parts[0].positions.data();
  const uint32_t* indices = puppet.scene.parts[0].indices.data();
  swap_vertices(*frame, puppet.scene);
  EXPECT_EQ(puppet.scene.parts[0].positions.data(), moved);
  EXPECT_EQ(frame->parts[0].positions.data(), still);
  EXPECT_EQ(puppet.scene.parts[0].indices.data(), indices);
  test::expect_consistent(puppet.scene);
}

TEST(AnimatedScene, boxes_of_all_times_are_one_box) {
  const AnimatedScene puppet = loaded("puppet.zip", puppet_zip());
  const std::vector<double> times = {0.0, 0.1, 0.2, 0.3};
  Box3d expected;
  for (const double t : times) {
    const auto frame = scene_at(puppet, 0, t);
    ASSERT_TRUE(frame.ok());
    for (size_t p = 0; p < 2; ++p) {
      for (const uint32_t index : puppet.scene.parts[p].indices) {
        expected.add(frame->parts[p].positions[index]);
      }
    }
  }
  const auto box = bounds_over(puppet, 0, times, RootMotion::kKeep);
  ASSERT_TRUE(box.ok());
  EXPECT_EQ(box->min, expected.min);
  EXPECT_EQ(box->max, expected.max);
  EXPECT_TRUE(bounds_over(puppet, 0, {}, RootMotion::kKeep)->empty());
}

// walk moves the hip along the file's x by 9 and z, up, by half a unit.
TEST(AnimatedScene, stripped_of_root_motion_the_root_stays_over_its_place) {
  const AnimatedScene puppet = loaded("puppet.zip", puppet_zip());
  const auto first = pose_at(puppet, 0, 0.0);
  auto last = pose_at(puppet, 0, 0.3);
  ASSERT_TRUE(first.ok() && last.ok());
  EXPECT_EQ(last->root, glm::dvec3(9, 10.5, -1));
  FrameVertices kept, stripped;
  ASSERT_TRUE(skin_vertices(puppet.skin, puppet.scene, *last, kept));
  Pose lying = *last;  // of a file whose z points up
  strip_root_motion(lying, first->root - glm::dvec3(0, 0, 4), 2);
  EXPECT_EQ(lying.root, glm::dvec3(0, first->root.y, -1));
  strip_root_motion(*last, first->root, 1);
  EXPECT_EQ(last->root, glm::dvec3(0, 10.5, -1));
  ASSERT_TRUE(skin_vertices(puppet.skin, puppet.scene, *last, stripped));
  for (size_t p = 0; p < kept.parts.size(); ++p) {
    for (size_t v = 0; v < kept.parts[p].positions.size(); ++v) {
      const glm::dvec3 way = stripped.parts[p].positions[v] - kept.parts[p].positions[v];
      EXPECT_LT(glm::distance(way, glm::dvec3(-9, 0, 0)), 1e-9);
      EXPECT_EQ(stripped.parts[p].normals[v], kept.parts[p].normals[v]);
    }
  }
  const std::vector<double> times = {0.0, 0.3};
  const auto wide = bounds_over(puppet, 0, times, RootMotion::kKeep);
  const auto narrow = bounds_over(puppet, 0, times, RootMotion::kStrip);
  ASSERT_TRUE(wide.ok() && narrow.ok());
  EXPECT_LT(narrow->max.x - narrow->min.x, wide->max.x - wide->min.x + 9);
  EXPECT_EQ(narrow->max.y, wide->max.y);
  EXPECT_NE(narrow->min.x, wide->min.x);
}

TEST(AnimatedScene, the_root_of_a_gltf_scene_is_its_topmost_joint) {
  const AnimatedScene animated = loaded(dancer());
  // The hip, at (3, 1, 0) of a node that turns y to z and stands at (10, 0, -3).
  auto pose = pose_at(animated, 0, 1.0);
  ASSERT_TRUE(pose.ok());
  EXPECT_LT(glm::distance(pose->root, glm::dvec3(13, 0, -2)), 1e-6);
  // Without skins it is what moves.
  GltfBuilder builder = dancer();
  builder.json.erase("skins");
  builder.json["nodes"][1].erase("skin");
  pose = pose_at(loaded(builder), 0, 1.0);
  ASSERT_TRUE(pose.ok());
  EXPECT_LT(glm::distance(pose->root, glm::dvec3(13, 0, -2)), 1e-6);
}

TEST(AnimatedScene, formats_without_joints_have_the_scene_alone) {
  const AnimatedScene still = loaded("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_EQ(still.scene.triangle_count(), 1u);
  EXPECT_EQ(still.rig, nullptr);
  EXPECT_EQ(message_of(pose_at(still, 0, 0.0)), "animation: the file has no animations: got 0");
  EXPECT_EQ(message_of(find_animation(still, "walk")),
            "animation: the file has no animations: got \"walk\"");
}

TEST(AnimatedScene, an_invalid_file_has_the_error_of_load_scene) {
  for (const std::string& text : {std::string("MD5Version 9"), std::string("{\"asset\":"),
                                  std::string("v 0 0 0"), std::string("PK\5\6")}) {
    const std::string message = message_of(load_scene("", test::bytes_of(text)));
    EXPECT_NE(message, "ok") << text;
    EXPECT_EQ(message_of(load_animated_scene("", test::bytes_of(text))), message);
  }
}

}  // namespace
}  // namespace voxeld
