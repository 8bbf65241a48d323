// Real files, where there are some: VOXELD_DATA_DIR.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "server/base/disk/file.h"
#include "tests/unit/scene_gltf/gltf_builder.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

// Files of one folder.
class FolderBundle : public Bundle {
 public:
  explicit FolderBundle(fs::path folder) : folder_(std::move(folder)) {}
  const std::vector<Entry>& entries() const override { return entries_; }
  Result<std::optional<Bytes>> find(std::string_view reference, std::string_view) const override {
    const fs::path path = folder_ / fs::path(reference).filename();
    if (!fs::exists(path)) return std::optional<Bytes>();
    VOXELD_ASSIGN(Bytes bytes, read_file(path));
    return std::optional<Bytes>(std::move(bytes));
  }

 private:
  fs::path folder_;
  std::vector<Entry> entries_;
};

class GltfFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    const char* dir = std::getenv("VOXELD_DATA_DIR");
    if (!dir) GTEST_SKIP() << "VOXELD_DATA_DIR is not set: no real meshes";
    dir_ = fs::path(dir) / "gltf";
  }
  Scene load(const std::string& name) {
    const fs::path path = dir_ / name;
    const auto bytes = read_file(path);
    EXPECT_TRUE(bytes.ok()) << path;
    if (!bytes) return {};
    auto scene = load_gltf(path.filename().string(), *bytes, FolderBundle(path.parent_path()), {});
    EXPECT_EQ(outcome(scene), "ok");
    return scene ? *std::move(scene) : Scene();
  }
  fs::path dir_;
};

TEST_F(GltfFiles, the_textured_box_is_the_same_in_its_three_forms) {
  const Scene plain = load("BoxTextured/glTF/BoxTextured.gltf");
  EXPECT_EQ(plain.triangle_count(), 12u);
  EXPECT_EQ(plain.vertex_count(), 24u);
  EXPECT_TRUE(plain.missing_files.empty());
  for (const char* name :
       {"BoxTextured/glTF-Embedded/BoxTextured.gltf", "BoxTextured/glTF-Binary/BoxTextured.glb"}) {
    const Scene other = load(name);
    ASSERT_EQ(other.parts.size(), plain.parts.size());
    EXPECT_EQ(other.parts[0].positions, plain.parts[0].positions);
    EXPECT_EQ(other.parts[0].normals, plain.parts[0].normals);
    EXPECT_EQ(other.parts[0].uvs, plain.parts[0].uvs);
    EXPECT_EQ(other.parts[0].indices, plain.parts[0].indices);
    ASSERT_EQ(other.images.size(), plain.images.size());
    for (size_t i = 0; i < plain.images.size(); ++i) {
      EXPECT_EQ(other.images[i].rgba, plain.images[i].rgba);
    }
  }
}

TEST_F(GltfFiles, the_duck_has_its_counts_and_its_height) {
  const Scene scene = load("Duck.glb");
  EXPECT_EQ(scene.triangle_count(), 4212u);
  EXPECT_EQ(scene.vertex_count(), 2399u);
  const Box3d box = scene.bounds();
  EXPECT_NEAR(box.max.y - box.min.y, 1.54, 0.02);  // metres, by the nodes' scale of 0.01
  EXPECT_TRUE(scene.has_colors());
  EXPECT_EQ(scene.images.at(0).width, 512);
}

TEST_F(GltfFiles, the_fox_stands_on_its_feet) {
  const Scene scene = load("Fox/Fox.gltf");
  EXPECT_EQ(scene.triangle_count(), 576u);
  EXPECT_EQ(scene.vertex_count(), 1728u);
  ASSERT_FALSE(scene.warnings.empty());
  EXPECT_EQ(scene.warnings[0].code, "static-pose");
  const Box3d box = scene.bounds();
  EXPECT_NEAR(box.min.y, 0, 1);
  EXPECT_GT(box.max.z - box.min.z, box.max.x - box.min.x);
}

TEST_F(GltfFiles, cesium_man_stands_upright) {
  const Scene scene = load("CesiumMan.glb");
  EXPECT_EQ(scene.triangle_count(), 4672u);
  EXPECT_EQ(scene.vertex_count(), 3273u);
  const Box3d box = scene.bounds();
  EXPECT_NEAR(box.max.y - box.min.y, 1.5, 0.1);
  EXPECT_NEAR(box.max.z - box.min.z, 1.14, 0.1);  // from hand to hand
  EXPECT_LT(box.max.x - box.min.x, 0.5);
}

}  // namespace
}  // namespace voxeld
