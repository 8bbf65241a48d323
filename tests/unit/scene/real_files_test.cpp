// Files of other programs. They are not part of the project: VOXELD_DATA_DIR names the folder where
// they lie, and without it these tests skip.
#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>

#include "server/base/disk/file.h"
#include "tests/unit/scene/scene_test_util.h"
#include "tests/unit/scene/zip_maker.h"

namespace voxeld {
namespace {

struct RealFile {
  const char* path;
  const char* format;
  size_t vertices;
  size_t triangles;
};

// STL vertices are welded; OBJ vertices are those that faces use, once for each texture coordinate
// and normal.
constexpr RealFile kFiles[] = {{"scans/bunny/bun_zipper.ply", "ply", 35947, 69451},
                               {"scans/bunny/bun_zipper_res2.ply", "ply", 8171, 16301},
                               {"scans/bunny/bun_zipper_res3.ply", "ply", 1889, 3851},
                               {"scans/bunny/bun_zipper_res4.ply", "ply", 453, 948},
                               {"scans/bunny/bunny_69451.stl", "stl", 34834, 69451},
                               {"scans/bunny/bunny.OBJ", "obj", 15330, 5110},
                               {"scans/dragon/dragon_vrip_res2.ply", "ply", 100250, 202520},
                               {"scans/dragon/dragon_vrip_res3.ply", "ply", 22998, 47794},
                               {"scans/dragon/dragon_vrip_res4.ply", "ply", 5205, 11102},
                               {"scans/buddha/buddha_100k.obj", "obj", 49950, 100000},
                               {"obj/spot/spot_quadrangulated.obj", "obj", 3225, 5856},
                               {"obj/spot/spot_control_mesh.obj", "obj", 267, 372},
                               {"obj/spot/spot_triangulated.obj", "obj", 3225, 5856},
                               {"obj/spider/spider.obj", "obj", 986, 1368},
                               {"stl/Spider_ascii.stl", "stl", 722, 1368},
                               {"stl/Spider_binary.stl", "stl", 722, 1368},
                               {"ply/cube.ply", "ply", 8, 12},
                               {"ply/cube_binary.ply", "ply", 8, 12},
                               {"ply/float-color.ply", "ply", 3, 1},
                               {"ply/Wuson.ply", "ply", 11184, 3732},
                               {"off/Wuson.off", "off", 3205, 3732},
                               {"off/cow.off", "off", 2762, 5520},
                               {"md5/bob/Bob.md5mesh", "md5mesh", 875, 1027}};

class RealFiles : public testing::Test {
 protected:
  void SetUp() override {
    const char* dir = std::getenv("VOXELD_DATA_DIR");
    if (dir == nullptr) GTEST_SKIP() << "VOXELD_DATA_DIR is not set: no real files to load";
    dir_ = dir;
  }
  std::string read(const std::string& path) const {
    const auto bytes = read_file(dir_ / path);
    EXPECT_TRUE(bytes) << path;
    return bytes ? std::string(bytes->begin(), bytes->end()) : "";
  }
  std::filesystem::path dir_;
};

TEST_F(RealFiles, have_the_counts_of_their_manifest) {
  for (const RealFile& file : kFiles) {
    const auto scene = test::load_text(file.path, read(file.path));
    ASSERT_TRUE(scene) << scene.error().message();
    test::expect_consistent(*scene);
    EXPECT_EQ(scene->format, file.format) << file.path;
    EXPECT_EQ(scene->vertex_count(), file.vertices) << file.path;
    EXPECT_EQ(scene->triangle_count(), file.triangles) << file.path;
  }
}

TEST_F(RealFiles, a_bundle_with_windows_paths_finds_all_its_textures) {
  test::ZipMaker zip;
  for (const char* name : {"spider.obj", "spider.mtl", "SpiderTex.jpg", "drkwood2.jpg",
                           "engineflare1.jpg", "wal67ar_small.jpg", "wal69ar_small.jpg"}) {
    zip.add(std::string("spider/") + name, read(std::string("obj/spider/") + name));
  }
  const auto scene = test::load_text("spider.zip", zip.bytes());
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_THAT(scene->warnings, testing::IsEmpty());
  EXPECT_EQ(scene->images.size(), scene->materials.size());
  EXPECT_TRUE(scene->has_colors());
}

TEST_F(RealFiles, spot_is_textured_though_no_file_says_so) {
  const std::string zip = test::ZipMaker()
                              .add("spot/spot.obj", read("obj/spot/spot_triangulated.obj"))
                              .add("spot/spot_texture.png", read("obj/spot/spot_texture.png"))
                              .bytes();
  const auto scene = test::load_text("spot.zip", zip);
  ASSERT_TRUE(scene) << scene.error().message();
  ASSERT_EQ(scene->warnings.size(), 1u);
  EXPECT_EQ(scene->warnings[0].code, "assumed-texture");
  EXPECT_TRUE(scene->has_colors());
}

}  // namespace
}  // namespace voxeld
