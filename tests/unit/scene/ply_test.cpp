#include <gmock/gmock.h>

#include "tests/unit/scene/scene_test_util.h"

namespace voxeld {
namespace {

using test::ByteWriter;
using test::load_text;
using test::message_of;

constexpr char kXyz[] = "property float x\nproperty float y\nproperty float z\n";
constexpr char kFaces[] = "property list uchar int vertex_indices\n";

// A text file of three vertices; `properties` and `rows` extend them.
std::string ascii(std::string_view vertex_properties, std::string_view face_properties,
                  std::string_view body, int vertices = 3, int faces = 1) {
  return "ply\nformat ascii 1.0\nelement vertex " + std::to_string(vertices) + "\n" + kXyz +
         std::string(vertex_properties) + "element face " + std::to_string(faces) + "\n" + kFaces +
         std::string(face_properties) + "end_header\n" + std::string(body);
}

// A tetrahedron's base and a quad with every scalar type, colours, lists in front of and behind
// what counts, and an element nobody knows.
std::string binary_ply(bool big_endian, std::string_view line_end = "\n") {
  std::string header =
      std::string("ply\nformat binary_") + (big_endian ? "big" : "little") +
      "_endian 1.0\ncomment hello\nelement camera 1\nproperty double fov\n"
      "property list ushort short shifts\nelement vertex 4\nproperty char id\n"
      "property double x\nproperty float y\nproperty int z\nproperty list uint8 "
      "ushort tags\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "element face 2\nproperty uint flags\nproperty list uint uint vertex_index\n"
      "property short last\nend_header\n";
  if (line_end != "\n") {
    std::string other;
    for (const char c : header) other += c == '\n' ? std::string(line_end) : std::string(1, c);
    header = other;
  }
  ByteWriter w(big_endian);
  w.text(header);
  w.add(60.0).add(uint16_t{2}).add(int16_t{1}).add(int16_t{2});
  const double xs[] = {0, 2, 2, 0};
  const float ys[] = {0, 0, 2, 2};
  for (int i = 0; i < 4; ++i) {
    w.add(static_cast<int8_t>(-i)).add(xs[i]).add(ys[i]).add(int32_t{-7});
    w.add(static_cast<uint8_t>(i));
    for (int k = 0; k < i; ++k) w.add(uint16_t{9});
    w.add(uint8_t{255}).add(uint8_t{128}).add(uint8_t{0});
  }
  w.add(uint32_t{1}).add(uint32_t{4}).add(uint32_t{0}).add(uint32_t{1}).add(uint32_t{2});
  w.add(uint32_t{3}).add(int16_t{-1});
  w.add(uint32_t{1}).add(uint32_t{3}).add(uint32_t{0}).add(uint32_t{1}).add(uint32_t{2});
  w.add(int16_t{-1});
  return w.bytes();
}

TEST(Ply, binary_of_both_orders_and_all_line_ends_is_the_same_mesh) {
  for (const bool big : {false, true}) {
    for (const char* line_end : {"\n", "\r\n", "\r"}) {
      const auto scene = load_text("a.ply", binary_ply(big, line_end));
      ASSERT_TRUE(scene) << scene.error().message();
      test::expect_consistent(*scene);
      EXPECT_EQ(scene->vertex_count(), 4u);
      EXPECT_EQ(scene->triangle_count(), 3u);
      EXPECT_EQ(scene->parts[0].positions[2], glm::dvec3(2, 2, -7));
      EXPECT_NEAR(scene->parts[0].colors[3].y, 0.2158605f, 1e-5f);
      EXPECT_EQ(scene->parts[0].colors[3].x, 1.0f);
      EXPECT_DOUBLE_EQ(test::area_of(*scene), 6.0);
    }
  }
}

TEST(Ply, every_truncation_of_a_binary_file_is_refused) {
  for (const bool big : {false, true}) {
    const std::string whole = binary_ply(big);
    test::expect_truncations_survive("a.ply", whole);
    for (size_t size = 0; size < whole.size(); ++size) {
      EXPECT_FALSE(load_text("a.ply", whole.substr(0, size))) << size;
    }
  }
}

TEST(Ply, text_reads_normals_texture_coordinates_and_colours) {
  const auto scene = load_text(
      "a.ply", ascii("property float nx\nproperty float ny\nproperty float nz\nproperty float s\n"
                     "property float t\nproperty uchar red\nproperty uchar green\n"
                     "property uchar blue\nproperty uchar alpha\nproperty float quality\n",
                     "",
                     "0 0 0 0 0 2 0 0 255 0 0 51 nan\n1 0 0 0 0 1 1 0 0 255 0 255 0\n"
                     "0 1 0 0 0 1 0 1 0 0 255 255 inf\n3 0 1 2\n"));
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  const MeshPart& part = scene->parts[0];
  EXPECT_EQ(part.normals[0], glm::vec3(0, 0, 1));
  EXPECT_EQ(part.uvs[2], glm::vec2(0, 0)) << "t = 1 is the top";
  EXPECT_EQ(glm::vec3(part.colors[0]), glm::vec3(1, 0, 0));
  EXPECT_FLOAT_EQ(part.colors[0].w, 0.2f);
}

TEST(Ply, colours_of_floats_are_linear) {
  const auto scene =
      load_text("a.ply", ascii("property float red\nproperty float green\nproperty float blue\n",
                               "", "0 0 0 0.5 0 2\n1 0 0 0 0 0\n0 1 0 0 0 0\n3 0 1 2\n"));
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->parts[0].colors[0], glm::vec4(0.5f, 0, 1, 1));
}

TEST(Ply, normals_without_direction_drop_all_normals) {
  const auto scene =
      load_text("a.ply", ascii("property float nx\nproperty float ny\nproperty float nz\n", "",
                               "0 0 0 0 0 1\n1 0 0 0 0 0\n0 1 0 nan 0 1\n3 0 1 2\n"));
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_TRUE(scene->parts[0].normals.empty());
}

TEST(Ply, face_colours_stay_on_their_faces) {
  const auto scene = load_text(
      "a.ply", ascii("", "property uchar red\nproperty uchar green\nproperty uchar blue\n",
                     "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 255 0 0\n3 0 1 2 0 0 255\n", 4, 2));
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  const MeshPart& part = scene->parts[0];
  ASSERT_EQ(part.positions.size(), 9u);
  EXPECT_EQ(part.colors[part.indices[5]], glm::vec4(1, 0, 0, 1));
  EXPECT_EQ(part.colors[part.indices[6]], glm::vec4(0, 0, 1, 1));
}

TEST(Ply, the_texture_named_in_a_comment_is_used) {
  std::string text = ascii("property float u\nproperty float v\n", "",
                           "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n");
  text.insert(text.find("element"), "comment TextureFile my skin.png\n");
  const auto scene = load_text("a.ply", text);
  ASSERT_TRUE(scene) << scene.error().message();
  ASSERT_EQ(scene->warnings.size(), 1u);
  EXPECT_EQ(scene->warnings[0].code, "missing-texture");
  EXPECT_EQ(scene->warnings[0].detail, "my skin.png, named by a.ply, is not in the upload");
  EXPECT_EQ(scene->parts[0].material, 0);
  EXPECT_EQ(scene->materials[0].image, -1);
}

TEST(Ply, corner_texture_coordinates_and_texture_numbers_make_parts) {
  std::string text = ascii(
      "", "property list uchar float texcoord\nproperty int texnumber\n",
      "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 8 0 0 1 0 1 1 0 1 1\n3 0 1 2 6 0 0 1 0 1 1 0\n", 4, 2);
  text.insert(text.find("element"), "comment TextureFile a.png\ncomment TextureFile b.png\n");
  const auto scene = load_text("a.ply", text);
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  ASSERT_EQ(scene->parts.size(), 2u);
  EXPECT_EQ(scene->parts[0].material, 1);
  EXPECT_EQ(scene->parts[0].indices.size(), 6u);
  EXPECT_EQ(scene->parts[1].material, 0);
  EXPECT_EQ(scene->parts[1].uvs[2], glm::vec2(1, 0));
}

TEST(Ply, faces_may_stand_before_vertices) {
  const auto scene = load_text("a.ply", std::string("ply\nformat ascii 1.0\nelement face 1\n") +
                                            kFaces + "element vertex 4\n" + kXyz +
                                            "end_header\n4 0 1 2 3\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_DOUBLE_EQ(test::area_of(*scene), 1.0);
}

TEST(Ply, faces_of_fewer_than_three_corners_are_left_out_with_a_warning) {
  const auto scene =
      load_text("a.ply", ascii("", "", "0 0 0\n1 0 0\n0 1 0\n2 0 1\n3 0 1 2\n0\n", 3, 3));
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->triangle_count(), 1u);
  ASSERT_EQ(scene->warnings.size(), 1u);
  EXPECT_EQ(scene->warnings[0].code, "skipped-faces");
  EXPECT_EQ(scene->warnings[0].detail, "a.ply: 2 faces with fewer than 3 corners were left out");
}

TEST(Ply, mistakes_of_the_header_are_reported) {
  const std::pair<std::string, const char*> cases[] = {
      {"", "a.ply line 1: wrong first line: expected \"ply\", got the end of the file"},
      {"plywood\n", "a.ply line 1: wrong first line: expected \"ply\", got \"plywood\\x0a\""},
      {"ply\nformat ascii 1.0\n",
       "a.ply line 2: truncated header: expected \"end_header\", got the end of the file"},
      {"ply\nend_header\n",
       "a.ply line 2: no format: expected \"format\" before \"end_header\", got none"},
      {"ply\nformat ebcdic 1.0\n",
       "a.ply line 2: format: expected ascii, binary_little_endian or binary_big_endian, got "
       "\"ebcdic\""},
      {"ply\nproperty float x\n",
       "a.ply line 2: property: expected an element before it, got none"},
      {"ply\nelement vertex -1\n",
       "a.ply line 2: element: expected a name and a count, got \"-1\""},
      {"ply\nelement vertex 1\nelement vertex 1\n",
       "a.ply line 3: element vertex: expected once, got twice"},
      {"ply\nelement vertex 1\nproperty half x\n",
       "a.ply line 3: property type: expected char, uchar, short, ushort, int, uint, float or "
       "double, got \"half\""},
      {"ply\nelement vertex 1\nproperty list float int x\n",
       "a.ply line 3: list length type: expected an integer type, got a floating-point type"},
      {"ply\nelement vertex 200000001\n",
       "a.ply line 2: too many elements vertex: expected at most 200000000, got 200000001"},
      {"ply\nformat ascii 1.0\nelement vertex 200000000\nproperty float x\nend_header\n1 2 3\n",
       "a.ply header: truncated: 200000000 elements \"vertex\" declared: expected at least 2 bytes "
       "for each, got 7 bytes left"},
      {"ply\nformat binary_little_endian 1.0\nelement other 9000000000000000000\n"
       "property double x\nend_header\n12345678",
       "a.ply header: truncated: 9000000000000000000 elements \"other\" declared: expected at "
       "least "
       "8 bytes for each, got 8 bytes left"},
      {"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n",
       "a.ply header: element vertex: expected properties x, y and z, got not all of them"},
      {std::string("ply\nformat ascii 1.0\nelement vertex 1\n") + kXyz +
           "element face 1\nproperty int n\nend_header\n0 0 0 1\n",
       "a.ply header: element face: expected a list property vertex_indices, got none"},
      {std::string("ply\nformat ascii 1.0\nelement vertex 1\n") + kXyz + "end_header\n0 0 0\n",
       "a.ply: the mesh is empty: expected at least one triangle, got no faces: a point cloud"},
      {std::string("ply\nformat ascii 1.0\nelement vertex 1\n") + kXyz +
           "element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n3 0 0 "
           "0\n",
       "a.ply: faces as element tristrips: expected element face, got element tristrips"}};
  for (const auto& [text, message] : cases) {
    EXPECT_EQ(message_of(load_text("a.ply", text)), message) << text;
  }
}

TEST(Ply, mistakes_of_the_body_are_reported_with_line_and_element) {
  const std::pair<std::string, const char*> cases[] = {
      {ascii("", "", "0 0 0\n1 0 0\n0 1 x\n3 0 1 2\n"),
       "a.ply line 12: vertex 2: z: expected a number, got \"x\""},
      {ascii("", "", "0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n"),
       "a.ply line 11: vertex 1: coordinate y: expected a finite number up to 1e30, got nan"},
      {ascii("", "", "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"),
       "a.ply line 13: face 0: vertex index out of range: expected 0..2, got 3"},
      {ascii("", "", "0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n"),
       "a.ply line 13: face 0: vertex index out of range: expected 0..2, got -1"},
      {ascii("", "", "0 0 0\n1 0 0\n0 1 0\n3 0 1 0.5\n"),
       "a.ply line 13: face 0: vertex index out of range: expected 0..2, got 0.500000"},
      {ascii("", "", "0 0 0\n1 0 0\n0 1 0\n3 0 1\n"),
       "a.ply line 14: face 0: vertex_indices: expected a number, got the end of the file"},
      {ascii("", "", "0 0 0\n1 0 0\n0 1 0\n-3 0 1 2\n"),
       "a.ply line 13: face 0: length of vertex_indices: expected a whole number from 0, got "
       "-3.000000"},
      {ascii("", "", "0 0 0\n1 0 0\n0 1 0\n4000000000 0 1 2\n"),
       "a.ply line 13: face 0: length of vertex_indices: expected as many as the file holds, got "
       "4000000000"},
      {ascii("", "property list uchar float texcoord\n",
             "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 4 0 0 0 0\n"),
       "a.ply line 14: face 0: texcoord: expected 6 numbers, got 4"}};
  for (const auto& [text, message] : cases) {
    EXPECT_EQ(message_of(load_text("a.ply", text)), message) << text;
  }
}

TEST(Ply, a_polygon_of_too_many_corners_is_refused) {
  std::string body = "0 0 0\n1 0 0\n0 1 0\n65537";
  for (int i = 0; i < 65'537; ++i) body += " 0";
  EXPECT_EQ(message_of(load_text("a.ply", ascii("", "", body))),
            "a.ply line 13: face 0: too many corners: expected at most 65536, got 65537");
}

}  // namespace
}  // namespace voxeld
