// load_scene: which file of a bundle is loaded, and what a scene says of itself.
#include <gmock/gmock.h>

#include "server/scene/load.h"
#include "tests/unit/scene/scene_test_util.h"
#include "tests/unit/scene/zip_maker.h"

namespace voxeld {
namespace {

using test::load_text;
using test::message_of;
using test::ZipMaker;

constexpr char kObjTriangle[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
constexpr char kOff[] = "OFF\n3 1 0\n0 0 0\n2 0 0\n0 2 0\n3 0 1 2\n";

TEST(LoadScene, finds_the_only_mesh_of_a_zip_among_other_files) {
  const std::string zip = ZipMaker()
                              .add("__MACOSX/._a.obj", "junk")
                              .add(".hidden/b.obj", "junk")
                              .add("readme.txt", "hello")
                              .add("sub/a.obj", kObjTriangle)
                              .bytes();
  const auto scene = load_text("bundle.zip", zip);
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->format, "obj");
  EXPECT_EQ(scene->triangle_count(), 1u);
}

TEST(LoadScene, several_meshes_are_an_error_that_lists_them) {
  const std::string zip = ZipMaker().add("a.obj", kObjTriangle).add("sub/b.off", kOff).bytes();
  const auto scene = load_text("two.zip", zip);
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, ErrorCode::kMalformedBundle);
  EXPECT_EQ(scene.error().message(),
            "two.zip: several meshes in the zip: expected one, or its choice by "
            "filename=two.zip!a.obj, got a.obj, sub/b.off");
}

TEST(LoadScene, the_name_after_an_exclamation_mark_chooses) {
  const std::string zip = ZipMaker().add("a.obj", kObjTriangle).add("sub/b.off", kOff).bytes();
  EXPECT_EQ(load_text("two.zip!sub/b.off", zip)->format, "off");
  EXPECT_EQ(load_text("two.zip!A.OBJ", zip)->format, "obj");
  EXPECT_EQ(message_of(load_text("two.zip!c.obj", zip)),
            "two.zip: no file \"c.obj\" in the zip: expected one of its files, got a.obj, "
            "sub/b.off");
}

TEST(LoadScene, the_error_of_a_zip_without_a_mesh_lists_its_files) {
  EXPECT_EQ(
      message_of(load_text("x.zip", ZipMaker().add("a.png", "").add("b.txt", "").bytes())),
      "x.zip: no mesh in the zip: expected one obj, ply, stl, off, gltf, glb or md5mesh file, got "
      "a.png, b.txt");
  EXPECT_EQ(message_of(load_text("x.zip", ZipMaker().bytes())),
            "x.zip: no mesh in the zip: expected one obj, ply, stl, off, gltf, glb or md5mesh "
            "file, got no "
            "files");
}

TEST(LoadScene, a_zip_inside_a_zip_is_refused) {
  const std::string inner = ZipMaker().add("a.obj", kObjTriangle).bytes();
  EXPECT_EQ(message_of(load_text("x.zip", ZipMaker().add("a.obj", inner).bytes())),
            "a.obj: a zip inside a zip: expected a mesh, got a zip");
}

TEST(LoadScene, a_3mf_package_may_be_in_a_zip) {
  const std::string package =
      ZipMaker()
          .add(
              "_rels/.rels",
              "<Relationships><Relationship Target=\"/3D/m.model\" Type=\"http://schemas.microsoft."
              "com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>")
          .add("3D/m.model",
               "<model xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\">"
               "<resources><object id=\"1\"><mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/>"
               "<vertex x=\"1\" y=\"0\" z=\"0\"/><vertex x=\"0\" y=\"1\" z=\"0\"/></vertices>"
               "<triangles><triangle v1=\"0\" v2=\"1\" v3=\"2\"/></triangles></mesh></object>"
               "</resources><build><item objectid=\"1\"/></build></model>")
          .bytes();
  for (const char* name : {"x.zip", "x.zip!files/part.3MF"}) {
    const auto scene =
        load_text(name, ZipMaker().add("files/part.3MF", package).add("a.png", "").bytes());
    ASSERT_TRUE(scene) << scene.error().message();
    EXPECT_EQ(scene->format, "3mf");
    EXPECT_EQ(scene->triangle_count(), 1u);
  }
}

TEST(LoadScene, a_file_that_is_named_zip_but_is_none_is_refused) {
  EXPECT_EQ(message_of(load_text("x.zip", kObjTriangle)),
            "zip: no end record: truncated, or not a zip");
}

TEST(LoadScene, a_ply_named_obj_is_loaded_as_a_ply) {
  const auto scene = load_text("a.obj",
                               "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
                               "property float y\nproperty float z\nelement face 1\n"
                               "property list uchar int vertex_indices\nend_header\n"
                               "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->format, "ply");
}

TEST(Scene, bounds_are_those_of_the_vertices_that_triangles_use) {
  const auto scene = load_text("a.off", "OFF\n4 1 0\n0 0 0\n2 0 0\n0 3 0\n99 99 99\n3 0 1 2\n");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->vertex_count(), 4u);
  EXPECT_EQ(scene->bounds().max, glm::dvec3(2, 3, 0));
  EXPECT_TRUE(Scene().bounds().empty());
}

TEST(FilesBundle, files_of_several_uploads_load_as_a_zip_of_them_does) {
  const std::string mesh = "mtllib a.mtl\n" + std::string(kObjTriangle);
  const auto bundle = files_bundle(
      {{"models/a.obj", test::bytes_of(mesh)}, {"a.mtl", test::bytes_of("newmtl x\nKd 1 0 0\n")}});
  ASSERT_EQ(bundle->entries().size(), 2u);
  EXPECT_EQ(bundle->entries()[0].name, "models/a.obj");
  EXPECT_EQ(bundle->entries()[1].bytes, 18);
  const auto scene = load_scene("things", *bundle);
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->triangle_count(), 1u);
  EXPECT_TRUE(scene->missing_files.empty());
}

TEST(FilesBundle, several_meshes_are_chosen_from_by_name) {
  const auto bundle =
      files_bundle({{"a.obj", test::bytes_of(kObjTriangle)}, {"b.off", test::bytes_of(kOff)}});
  EXPECT_EQ(message_of(load_scene("two", *bundle)),
            "two: several meshes in the bundle: expected one, or its choice by "
            "filename=two!a.obj, got a.obj, b.off");
  EXPECT_EQ(load_scene("two!b.off", *bundle)->format, "off");
  EXPECT_EQ(message_of(load_scene("two!c", *bundle)),
            "two: no file \"c\" in the bundle: expected one of its files, got a.obj, b.off");
}

TEST(Scene, colours_come_from_vertices_textures_or_materials) {
  Scene scene;
  scene.parts.emplace_back();
  EXPECT_FALSE(scene.has_colors());
  scene.materials.emplace_back();
  scene.parts[0].material = 0;
  EXPECT_FALSE(scene.has_colors());
  scene.materials[0].image = 0;
  EXPECT_FALSE(scene.has_colors()) << "a texture without coordinates shows nowhere";
  scene.parts[0].uvs.emplace_back();
  EXPECT_TRUE(scene.has_colors());
  scene.parts[0].uvs.clear();
  scene.parts[0].colors.emplace_back();
  EXPECT_TRUE(scene.has_colors());
  scene.parts[0].colors.clear();
  scene.colors_given = true;
  EXPECT_TRUE(scene.has_colors());
}

}  // namespace
}  // namespace voxeld
