#include "server/scene/describe_asset.h"

#include <gtest/gtest.h>

#include "tests/unit/scene/zip_maker.h"
#include "tests/unit/scene_animation/animation_fixtures.h"

namespace voxeld {
namespace {

TEST(DescribeAsset, an_md5_bundle_lists_joints_meshes_materials_and_animations) {
  const std::string zip = test::ZipMaker()
                              .add("puppet.md5mesh", puppet_mesh())
                              .add("walk.md5anim", puppet_walk())
                              .add("textures/Lamp.tga", "pixels")
                              .bytes();
  const AssetDescription asset = describe_asset(loaded("puppet.zip", zip));
  EXPECT_EQ(asset.format, "md5mesh");
  ASSERT_EQ(asset.joints.size(), 5u);
  EXPECT_EQ(asset.joints[2].name, "hand");
  EXPECT_EQ(asset.joints[2].parent, 1);
  ASSERT_EQ(asset.meshes.size(), 2u);
  EXPECT_EQ(asset.meshes[0].name, "cloth");
  EXPECT_EQ(asset.meshes[0].triangle_count, 2);
  EXPECT_EQ(asset.meshes[0].influences_max, 3);
  EXPECT_FALSE(asset.meshes[0].has_morph_targets);
  ASSERT_EQ(asset.materials.size(), 2u);
  EXPECT_EQ(asset.materials[0].name, "cloth");
  EXPECT_EQ(asset.materials[0].image, "");
  EXPECT_EQ(asset.materials[1].image, "textures/Lamp.tga");
  EXPECT_EQ(asset.meshes[1].material, 1);
  ASSERT_EQ(asset.missing_files.size(), 1u);
  EXPECT_EQ(asset.missing_files[0].name, "cloth");
  EXPECT_EQ(asset.missing_files[0].needed_by, "material \"cloth\"");
  ASSERT_EQ(asset.animations.size(), 1u);
  EXPECT_EQ(asset.animations[0].name, "walk");
  EXPECT_EQ(asset.animations[0].frame_count, 4);
  EXPECT_DOUBLE_EQ(asset.animations[0].frame_rate, 10);
  EXPECT_DOUBLE_EQ(asset.animations[0].duration_s, 0.3);
  EXPECT_FALSE(asset.bounds.empty());
  EXPECT_FALSE(asset.warnings.empty());
}

TEST(DescribeAsset, an_animation_that_cannot_be_used_is_listed_with_its_reason) {
  const std::string zip = test::ZipMaker()
                              .add("puppet.md5mesh", puppet_mesh())
                              .add("cut.md5anim", "MD5Version 10")
                              .add("walk.md5anim", puppet_walk())
                              .bytes();
  const AssetDescription asset = describe_asset(loaded("puppet.zip", zip));
  EXPECT_EQ(asset.joints.size(), 5u);
  ASSERT_EQ(asset.animations.size(), 2u);
  ASSERT_TRUE(asset.animations[0].unusable);
  EXPECT_EQ(asset.animations[0].unusable->message(),
            "cut.md5anim: no joints: expected hierarchy { … }");
  EXPECT_EQ(asset.animations[1].frame_count, 4);
}

TEST(DescribeAsset, a_gltf_scene_lists_influences_and_morph_targets) {
  const AssetDescription asset = describe_asset(loaded(dancer()));
  EXPECT_EQ(asset.format, "gltf");
  ASSERT_EQ(asset.meshes.size(), 3u);
  EXPECT_EQ(asset.meshes[0].name, "ribbon");
  EXPECT_EQ(asset.meshes[0].influences_max, 3);
  EXPECT_EQ(asset.meshes[1].influences_max, 1);
  EXPECT_TRUE(asset.meshes[1].has_morph_targets);
  EXPECT_FALSE(asset.meshes[2].has_morph_targets);
  EXPECT_EQ(asset.joints.size(), 3u);
  EXPECT_EQ(asset.animations.size(), 2u);
}

TEST(DescribeAsset, a_still_mesh_has_neither) {
  const AssetDescription asset =
      describe_asset(loaded("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
  EXPECT_EQ(asset.format, "obj");
  ASSERT_EQ(asset.meshes.size(), 1u);
  EXPECT_EQ(asset.meshes[0].influences_max, 0);
  EXPECT_TRUE(asset.joints.empty());
  EXPECT_TRUE(asset.animations.empty());
  EXPECT_EQ(asset.bounds.max, glm::dvec3(1, 1, 0));
}

}  // namespace
}  // namespace voxeld
