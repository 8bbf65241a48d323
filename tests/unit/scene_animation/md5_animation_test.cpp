// MD5 animations on MD5 meshes, against tests/reference.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/scene/scene_test_util.h"
#include "tests/unit/scene/zip_maker.h"
#include "tests/unit/scene_animation/animation_fixtures.h"

namespace voxeld {
namespace {

using testing::HasSubstr;

constexpr double kTimes[] = {0.0, 0.031, 0.1, 0.15, 0.2501, 0.3};

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

// Why the animation cannot be used, beside one that can.
std::string unusable_message(std::string anim) {
  const std::string zip = test::ZipMaker()
                              .add("a.md5mesh", puppet_mesh())
                              .add("b.md5anim", std::move(anim))
                              .add("good.md5anim", puppet_walk())
                              .bytes();
  const AnimatedScene puppet = loaded("a.zip", zip);
  EXPECT_EQ(puppet.animations.size(), 2u);
  EXPECT_EQ(puppet.animations.at(0).name, "b");
  EXPECT_FALSE(puppet.animations.at(1).unusable);
  const auto& unusable = puppet.animations.at(0).unusable;
  return unusable ? unusable->message() : "ok";
}

// The puppet with animations of three kinds: whole, cut off, and of another mesh.
std::string mixed_zip() {
  std::string foreign = puppet_walk();
  foreign.replace(foreign.find("\"hand\""), 6, "\"foot\"");
  return test::ZipMaker()
      .add("p.md5mesh", puppet_mesh())
      .add("cut.md5anim", puppet_wave().substr(0, 200))
      .add("foreign.md5anim", foreign)
      .add("empty.md5anim", "")
      .add("walk.md5anim", puppet_walk())
      .add("wave.md5anim", puppet_wave())
      .bytes();
}

TEST(Md5Animation, each_of_a_zip_stands_for_itself) {
  const AnimatedScene puppet = loaded("puppet.zip", mixed_zip());
  EXPECT_EQ(puppet.joints.size(), 5u);
  ASSERT_EQ(puppet.animations.size(), 5u);
  for (const size_t bad : {0u, 1u, 2u}) {
    const AnimationInfo& animation = puppet.animations[bad];
    ASSERT_TRUE(animation.unusable) << animation.name;
    EXPECT_EQ(animation.frame_count, 0) << animation.name;
    EXPECT_EQ(animation.duration_s, 0.0) << animation.name;
    const std::string reason = animation.unusable->message();
    for (const std::string& choice : {animation.name, std::to_string(bad)}) {
      EXPECT_EQ(test::message_of(find_animation(puppet, choice)), reason);
    }
    EXPECT_EQ(test::message_of(scene_at(puppet, bad, 0.0)), reason);
    EXPECT_EQ(puppet.scene.warnings.at(puppet.scene.warnings.size() - 3 + bad).code,
              "ignored-animation");
    EXPECT_EQ(puppet.scene.warnings.at(puppet.scene.warnings.size() - 3 + bad).detail, reason);
  }
  EXPECT_THAT(puppet.animations[0].unusable->message(), testing::StartsWith("cut.md5anim line "));
  EXPECT_EQ(puppet.animations[1].unusable->message(),
            "foreign.md5anim does not fit p.md5mesh: joints that only the mesh has: expected the "
            "mesh's joints, got \"hand\"");
  EXPECT_EQ(puppet.animations[2].unusable->message(),
            "empty.md5anim line 1: wrong keyword: expected MD5Version, got the end of the file");
  const auto mesh = reference::read_md5_mesh(puppet_mesh());
  const auto walk = reference::read_md5_anim(puppet_walk());
  const auto wave = reference::read_md5_anim(puppet_wave());
  EXPECT_EQ(find_animation(puppet, "walk").value(), 3u);
  EXPECT_EQ(find_animation(puppet, "4").value(), 4u);
  for (const double t : kTimes) {
    expect_frame(frame_of(puppet, 3, t), reference::md5_frame(mesh, &walk, t));
    expect_frame(frame_of(puppet, 4, t), reference::md5_frame(mesh, &wave, t));
  }
}

TEST(Md5Animation, the_default_is_the_first_that_can_be_used) {
  EXPECT_EQ(default_animation(loaded("puppet.zip", mixed_zip())).value(), 3u);
  EXPECT_EQ(default_animation(loaded("puppet.zip", puppet_zip())).value(), 0u);
  const std::string zip = test::ZipMaker()
                              .add("a.md5mesh", puppet_mesh())
                              .add("b.md5anim", "")
                              .add("c.md5anim", "?")
                              .bytes();
  EXPECT_EQ(test::message_of(default_animation(loaded("a.zip", zip))),
            "b.md5anim line 1: wrong keyword: expected MD5Version, got the end of the file");
  EXPECT_EQ(test::message_of(default_animation(loaded("a.md5mesh", puppet_mesh()))),
            "animation: the file has no animations");
}

TEST(Md5Animation, a_broken_entry_of_the_zip_is_an_animation_that_cannot_be_used) {
  std::string zip = test::ZipMaker()
                        .add("a.md5mesh", puppet_mesh())
                        .add("walk.md5anim", puppet_walk())
                        .add("wave.md5anim", puppet_wave())
                        .bytes();
  zip[zip.find("walk.md5anim") + 40] ^= 0x55;  // its checksum is wrong now
  const AnimatedScene puppet = loaded("a.zip", zip);
  ASSERT_EQ(puppet.animations.size(), 2u);
  ASSERT_TRUE(puppet.animations[0].unusable);
  EXPECT_THAT(puppet.animations[0].unusable->message(), HasSubstr("walk.md5anim"));
  EXPECT_FALSE(puppet.animations[1].unusable);
}

TEST(Md5Animation, marks_and_line_ends_make_no_difference) {
  std::string walk = puppet_walk(), utf16 = "\xff\xfe";
  for (char& c : walk) c = c == '\n' ? '\r' : c;
  for (const char c : walk) utf16.append(1, c).append(1, '\0');
  for (const std::string& text : {"\xef\xbb\xbf" + walk + '\0', utf16 + '\x1a'}) {
    const std::string zip =
        test::ZipMaker().add("a.md5mesh", puppet_mesh()).add("walk.md5anim", text).bytes();
    const AnimatedScene puppet = loaded("a.zip", zip);
    ASSERT_EQ(puppet.animations.size(), 1u);
    EXPECT_FALSE(puppet.animations[0].unusable) << puppet.animations[0].unusable->message();
    EXPECT_EQ(puppet.animations[0].frame_count, 4);
  }
}

TEST(Md5Animation, one_that_does_not_fit_names_the_joints) {
  std::string anim = puppet_walk();
  anim.replace(anim.find("\"hand\""), 6, "\"foot\"");
  EXPECT_EQ(unusable_message(anim),
            "b.md5anim does not fit a.md5mesh: joints that only the mesh has: expected the mesh's "
            "joints, got \"hand\"");
  anim = puppet_walk();
  anim.replace(anim.find("\"hand\" 3"), 8, "\"hand\" 1");
  EXPECT_EQ(unusable_message(anim),
            "b.md5anim does not fit a.md5mesh: joints with other parents: expected the parents of "
            "the mesh, got \"hand\"");
  anim = puppet_walk();
  anim.replace(anim.find("\"hand\" 3"), 8, "\"hand\" 4");
  EXPECT_EQ(unusable_message(anim),
            "b.md5anim line 12: parent of joint \"hand\": expected -1 or the number of a joint "
            "before it, 0..3, got \"4\"");
}

TEST(Md5Animation, each_mesh_of_a_zip_can_use_the_animations_that_fit) {
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
  ASSERT_EQ(puppet.animations.size(), 2u);
  EXPECT_EQ(puppet.animations[0].name, "b");
  EXPECT_TRUE(puppet.animations[0].unusable);
  EXPECT_EQ(puppet.animations[1].name, "a");
  EXPECT_FALSE(puppet.animations[1].unusable);
  ASSERT_FALSE(puppet.scene.warnings.empty());
  EXPECT_EQ(puppet.scene.warnings.back().code, "ignored-animation");
  EXPECT_EQ(puppet.scene.warnings.back().detail,
            "b.md5anim does not fit a.md5mesh: joints that only the mesh has: expected the mesh's "
            "joints, got \"hand\"");
}

TEST(Md5Animation, a_broken_one_is_named_with_its_line) {
  std::string anim = puppet_walk();
  anim.replace(anim.find("10.5"), 4, "nan");
  EXPECT_EQ(unusable_message(anim),
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
