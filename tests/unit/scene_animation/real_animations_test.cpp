// Animations of other people's files, where there are some (VOXELD_DATA_DIR), against
// tests/reference.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "server/base/disk/file.h"
#include "tests/unit/scene/zip_maker.h"
#include "tests/unit/scene_animation/animation_fixtures.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

class RealAnimations : public testing::Test {
 protected:
  void SetUp() override {
    const char* dir = std::getenv("VOXELD_DATA_DIR");
    if (dir == nullptr) GTEST_SKIP() << "VOXELD_DATA_DIR is not set: no real animations";
    dir_ = dir;
  }
  std::string read(const std::string& path) const {
    const auto bytes = read_file(dir_ / path);
    EXPECT_TRUE(bytes.ok()) << path;
    return bytes ? std::string(bytes->begin(), bytes->end()) : "";
  }
  static std::vector<uint8_t> bytes_of(const std::string& text) {
    return {text.begin(), text.end()};
  }
  // Seven times of each animation, its ends among them.
  static void expect_oracle(const AnimatedScene& animated, const Json& json,
                            const std::vector<std::vector<uint8_t>>& buffers) {
    for (size_t a = 0; a < animated.animations.size(); ++a) {
      for (int i = 0; i <= 6; ++i) {
        const double t = animated.animations[a].duration_s * i / 6.0;
        SCOPED_TRACE(animated.animations[a].name + " at " + std::to_string(t));
        const auto frame = scene_at(animated, a, t);
        ASSERT_TRUE(frame.ok()) << frame.error().message();
        expect_frame(*frame, animated.scene,
                     reference::gltf_frame(json, buffers, static_cast<int>(a), t));
      }
    }
  }
  fs::path dir_;
};

TEST_F(RealAnimations, bob_with_his_lamp) {
  const std::string mesh_text = read("md5/bob/Bob.md5mesh"), text = read("md5/bob/Bob.md5anim");
  const AnimatedScene bob = loaded(
      "bob.zip", test::ZipMaker().add("Bob.md5mesh", mesh_text).add("Bob.md5anim", text).bytes());
  ASSERT_EQ(bob.animations.size(), 1u);
  EXPECT_EQ(bob.animations[0].name, "Bob");
  EXPECT_EQ(bob.animations[0].frame_count, 140);
  EXPECT_DOUBLE_EQ(bob.animations[0].duration_s, 139 / 24.0);
  const auto mesh = reference::read_md5_mesh(mesh_text);
  const auto anim = reference::read_md5_anim(text);
  for (const double t : {0.0, 0.01, 1.0, 2.345, 3.5, 5.0, 139 / 24.0}) {
    SCOPED_TRACE(t);
    const auto frame = scene_at(bob, 0, t);
    ASSERT_TRUE(frame.ok()) << frame.error().message();
    expect_frame(*frame, reference::md5_frame(mesh, &anim, t));
  }
}

TEST_F(RealAnimations, cesium_man_walks) {
  const std::string bytes = read("gltf/CesiumMan.glb");
  const AnimatedScene man = loaded("CesiumMan.glb", bytes);
  ASSERT_EQ(man.animations.size(), 1u);
  EXPECT_EQ(man.joints.size(), 19u);
  EXPECT_DOUBLE_EQ(man.animations[0].duration_s, 2.0);
  std::vector<std::vector<uint8_t>> buffers;
  const Json json = reference::read_glb(bytes_of(bytes), buffers);
  expect_oracle(man, json, buffers);
}

TEST_F(RealAnimations, the_fox_looks_walks_and_runs) {
  const std::string gltf = read("gltf/Fox/Fox.gltf"), bin = read("gltf/Fox/Fox.bin");
  const AnimatedScene fox =
      loaded("fox.zip", test::ZipMaker().add("Fox.gltf", gltf).add("Fox.bin", bin).bytes());
  ASSERT_EQ(fox.animations.size(), 3u);
  EXPECT_EQ(find_animation(fox, "Run").value(), 2u);
  expect_oracle(fox, Json::parse(gltf), {bytes_of(bin)});
}

}  // namespace
}  // namespace voxeld
