// MD5 animations on MD5 meshes, against tests/reference.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/scene/scene_test_util.h"
#include "tests/unit/scene/zip_maker.h"
#include "tests/unit/scene_animation/animation_fixtures.h"

namespace voxeld {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kTimes[] = {0.0, 0.031, 0.1, 0.15, 0.2501, 0.3};

FrameVertices frame_of(const AnimatedScene& animated, size_t animation, double seconds) {
  auto frame = scene_at(animated, animation, seconds);
  EXPECT_TRUE(frame.ok()) << frame.error().message();
  return frame ? *std::move(frame) : FrameVertices();
}

TEST(Md5Animation, frames_are_those_of_the_oracle) {
  const AnimatedScene puppet = loaded("puppet.zip", puppet_zip());
  const auto mesh = reference::read_md5_mesh(puppet_mesh());
  const auto walk = reference::read_md5_anim(puppet_walk());
  const auto wave = reference::read_md5_anim(puppet_wave());
  ASSERT_EQ(puppet.animations.size(), 2u);
  for (const double t : kTimes) {
    SCOPED_TRACE(t);
    expect_frame(frame_of(puppet, 0, t), reference::md5_frame(mesh, &walk, t));
    expect_frame(frame_of(puppet, 1, t), reference::md5_frame(mesh, &wave, t));
  }
}

TEST(Md5Animation, the_rest_pose_is_the_bind_pose) {
  const AnimatedScene puppet = loaded("puppet.zip", puppet_zip());
  FrameVertices rest;
  ASSERT_TRUE(skin_vertices(puppet.skin, puppet.scene, puppet.rig->rest(), rest));
  expect_frame(rest, reference::md5_frame(reference::read_md5_mesh(puppet_mesh()), nullptr, 0));
  for (size_t p = 0; p < rest.parts.size(); ++p) {
    const MeshPart& part = puppet.scene.parts[p];
    for (size_t v = 0; v < part.positions.size(); ++v) {
      EXPECT_LT(glm::distance(rest.parts[p].positions[v], part.positions[v]), 1e-12);
      EXPECT_LT(glm::distance(rest.parts[p].normals[v], part.normals[v]), 1e-6f);
    }
  }
}

TEST(Md5Animation, files_of_a_zip_are_named_by_their_stems) {
  const AnimatedScene puppet = loaded("puppet.zip", puppet_zip());
  ASSERT_EQ(puppet.animations.size(), 2u);
  EXPECT_EQ(puppet.animations[0].name, "walk");
  EXPECT_EQ(puppet.animations[0].frame_count, 4);
  EXPECT_EQ(puppet.animations[0].frame_rate, 10.0);
  EXPECT_DOUBLE_EQ(puppet.animations[0].duration_s, 0.3);
  EXPECT_EQ(puppet.animations[1].name, "wave");
  const std::string two = test::ZipMaker()
                              .add("a.md5mesh", puppet_mesh())
                              .add("one/walk.md5anim", puppet_walk())
                              .add("two/walk.md5anim", puppet_walk())
                              .bytes();
  const AnimatedScene twice = loaded("a.zip", two);
  ASSERT_EQ(twice.animations.size(), 2u);
  EXPECT_EQ(twice.animations[0].name, "one/walk");
  EXPECT_EQ(twice.animations[1].name, "two/walk");
}

TEST(Md5Animation, a_mesh_alone_has_its_joints_and_no_animations) {
  const AnimatedScene puppet = loaded("puppet.md5mesh", puppet_mesh());
  EXPECT_TRUE(puppet.animations.empty());
  ASSERT_EQ(puppet.joints.size(), 5u);
  EXPECT_EQ(puppet.joints[4].name, "flame");
  EXPECT_EQ(puppet.joints[4].parent, 3);
  EXPECT_EQ(puppet.joints[3].parent, -1);
  EXPECT_EQ(test::message_of(scene_at(puppet, 0, 0.0)),
            "animation: the file has no animations: got 0");
}

std::string zip_message(std::string anim) {
  const std::string zip =
      test::ZipMaker().add("a.md5mesh", puppet_mesh()).add("b.md5anim", std::move(anim)).bytes();
  return test::message_of(load_animated_scene("a.zip", test::bytes_of(zip)));
}

TEST(Md5Animation, one_that_does_not_fit_names_the_joints) {
  std::string anim = puppet_walk();
  anim.replace(anim.find("\"hand\""), 6, "\"foot\"");
  EXPECT_EQ(zip_message(anim),
            "b.md5anim does not fit a.md5mesh: joints that only the mesh has: expected the mesh's "
            "joints, got \"hand\"");
  anim = puppet_walk();
  anim.replace(anim.find("\"hand\" 3"), 8, "\"hand\" 1");
  EXPECT_EQ(zip_message(anim),
            "b.md5anim does not fit a.md5mesh: joints with other parents: expected the parents of "
            "the mesh, got \"hand\"");
  anim = puppet_walk();
  anim.replace(anim.find("\"hand\" 3"), 8, "\"hand\" 4");
  EXPECT_EQ(zip_message(anim),
            "b.md5anim line 12: parent of joint \"hand\": expected a whole number from -1 to 3, "
            "got \"4\"");
}

TEST(Md5Animation, of_several_meshes_in_a_zip_each_has_those_that_fit) {
  std::string other_mesh = puppet_mesh(), other_anim = puppet_walk();
  other_mesh.replace(other_mesh.find("\"hand\""), 6, "\"foot\"");
  other_anim.replace(other_anim.find("\"hand\""), 6, "\"foot\"");
  const std::string zip = test::ZipMaker()
                              .add("a.md5mesh", puppet_mesh())
                              .add("b.md5mesh", other_mesh)
                              .add("b.md5anim", other_anim)
                              .add("a.md5anim", puppet_walk())
                              .bytes();
  const AnimatedScene puppet = loaded("p.zip!a.md5mesh", zip);
  ASSERT_EQ(puppet.animations.size(), 1u);
  EXPECT_EQ(puppet.animations[0].name, "a");
  ASSERT_FALSE(puppet.scene.warnings.empty());
  EXPECT_EQ(puppet.scene.warnings.back().code, "ignored-animation");
  EXPECT_EQ(puppet.scene.warnings.back().detail,
            "b.md5anim does not fit a.md5mesh: joints that only the mesh has: expected the mesh's "
            "joints, got \"hand\"");
}

TEST(Md5Animation, a_broken_one_is_named_with_its_line) {
  std::string anim = puppet_walk();
  anim.replace(anim.find("10.5"), 4, "nan");
  EXPECT_EQ(zip_message(anim),
            "b.md5anim line 31: a number of a frame: expected a finite number, got \"nan\"");
}

TEST(Md5Animation, biases_count_as_they_are_with_a_warning) {
  std::string mesh = puppet_mesh();
  mesh.replace(mesh.find("weight 0 0 1 "), 13, "weight 0 0 2 ");
  const AnimatedScene puppet = loaded("a.md5mesh", mesh);
  bool is_warned = false;
  for (const Warning& warning : puppet.scene.warnings) {
    if (warning.code != "uneven-weights") continue;
    is_warned = true;
    EXPECT_EQ(warning.detail,
              "a.md5mesh: the biases of 1 vertices do not add up to 1; they count as they are");
  }
  EXPECT_TRUE(is_warned);
  FrameVertices rest;
  ASSERT_TRUE(skin_vertices(puppet.skin, puppet.scene, puppet.rig->rest(), rest));
  expect_frame(rest, reference::md5_frame(reference::read_md5_mesh(mesh), nullptr, 0));
}

TEST(Md5Animation, orientations_longer_than_one_are_directions) {
  std::string anim = puppet_wave();
  anim.replace(anim.find("0.1 -0.2 0.3\n}"), 12, "2 -4 4");
  const std::string zip =
      test::ZipMaker().add("a.md5mesh", puppet_mesh()).add("b.md5anim", anim).bytes();
  const AnimatedScene puppet = loaded("a.zip", zip);
  const auto mesh = reference::read_md5_mesh(puppet_mesh());
  const auto wave = reference::read_md5_anim(anim);
  expect_frame(frame_of(puppet, 0, 1.0), reference::md5_frame(mesh, &wave, 1.0));
}

TEST(Md5Animation, a_vertex_that_leaves_the_world_is_an_error) {
  std::string anim = puppet_wave();
  anim.replace(anim.find("-20 5 7"), 7, "1e30 1e30 1e30");
  std::string mesh = puppet_mesh();
  mesh.replace(mesh.find("weight 0 3 1 "), 13, "weight 0 3 3 ");
  const std::string zip = test::ZipMaker().add("a.md5mesh", mesh).add("b.md5anim", anim).bytes();
  const AnimatedScene puppet = loaded("a.zip", zip);
  EXPECT_THAT(test::message_of(scene_at(puppet, 0, 1.0)),
              HasSubstr("part 1: vertex 0 of \"lamp\" gets to no finite place"));
  EXPECT_TRUE(scene_at(puppet, 0, 0.0));
}

}  // namespace
}  // namespace voxeld
