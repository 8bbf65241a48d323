#include <gmock/gmock.h>

#include "server/scene/load.h"
#include "tests/unit/scene/scene_test_util.h"
#include "tests/unit/scene/zip_maker.h"

namespace voxeld {
namespace {

using test::bytes_of;

std::string detected(std::string_view filename, std::string_view bytes) {
  const auto format = detect_format(filename, bytes_of(bytes));
  return format ? std::string(mesh_format_name(*format)) : format.error().message();
}

std::string binary_stl(uint32_t count, std::string_view header = "") {
  std::string bytes(header);
  bytes.resize(80);
  bytes.append(reinterpret_cast<const char*>(&count), 4);
  bytes.append(size_t{count} * 50, '\0');
  return bytes;
}

TEST(DetectFormat, extensions_of_any_case_tell) {
  for (const char* name : {"obj", "ply", "stl", "off", "gltf", "glb", "zip"}) {
    EXPECT_EQ(detected(std::string("a.b.") + name, "?"), name);
  }
  EXPECT_EQ(detected("models/BUNNY.OBJ", "?"), "obj");
}

TEST(DetectFormat, first_bytes_tell_where_the_name_does_not) {
  EXPECT_EQ(detected("", "ply\nformat ascii 1.0\n"), "ply");
  EXPECT_EQ(detected("upload", "glTF\2"), "glb");
  EXPECT_EQ(detected("upload.bin", "PK\3\4..."), "zip");
  EXPECT_EQ(detected("", "  {\"asset\": {\"version\": \"2.0\"}}"), "gltf");
  EXPECT_EQ(detected("", "OFF\n8 6 0\n"), "off");
  EXPECT_EQ(detected("", "# a comment\nOFF8 6 0\n"), "off");
  EXPECT_EQ(detected("", "STCNOFF 1 1 1"), "off");
  EXPECT_EQ(detected("", "4OFF 1 1 1"), "off");
  EXPECT_EQ(detected("", "solid cube\n facet normal 0 0 1\n"), "stl");
  EXPECT_EQ(detected("", binary_stl(2)), "stl");
  EXPECT_EQ(detected("", binary_stl(1, "solid by some exporter")), "stl");
  EXPECT_EQ(detected("", "# Blender\r\nmtllib a.mtl\r\n"), "obj");
  EXPECT_EQ(detected("", "o cube\nv 1.0 2.0 3.0\n"), "obj");
}

TEST(DetectFormat, bytes_that_prove_a_format_win_over_the_extension) {
  EXPECT_EQ(detected("a.obj", "ply\nformat ascii 1.0\n"), "ply");
  EXPECT_EQ(detected("a.stl", "glTF\2"), "glb");
  EXPECT_EQ(detected("a.glb", "{\"asset\":{}}"), "gltf");
  EXPECT_EQ(detected("a.gltf", "PK\3\4"), "zip");
}

TEST(DetectFormat, other_bytes_are_refused_with_the_formats_that_are_read) {
  EXPECT_EQ(detected("a.fbx", "Kaydara FBX Binary  \x00"),
            "a.fbx: not a format that voxeld reads: expected obj, ply, stl, off, gltf, glb, "
            "md5mesh, 3mf, a zip of one of them with its files, or voxels: voxg, vox, binvox, npy, "
            "nrrd, got first bytes \"Kaydara FBX Bina\"");
  EXPECT_EQ(detected("", ""),
            "the upload: not a format that voxeld reads: expected obj, ply, stl, off, gltf, glb, "
            "md5mesh, 3mf, a zip of one of them with its files, or voxels: voxg, vox, binvox, npy, "
            "nrrd, got no bytes");
  for (const char* name : {"a.ply.gz", "a.ply"}) {
    EXPECT_THAT(detected(name, "\x1f\x8b\x08"),
                testing::EndsWith("got a gzip file, which has to be unpacked first"));
  }
  for (const char* text : {"hello world", "{\"a\": 1}", "v one two three\n", "v 1 2\n", "plywood\n",
                           "XOFF\n", "solidarity\n", "\n\n"}) {
    const auto format = detect_format("", bytes_of(text));
    ASSERT_FALSE(format) << text;
    EXPECT_EQ(format.error().code, ErrorCode::kUnsupportedMedia);
  }
}

}  // namespace
}  // namespace voxeld
