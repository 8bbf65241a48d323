#include <gmock/gmock.h>

#include <cmath>

#include "tests/unit/base/points_passed.h"
#include "tests/unit/scene/scene_test_util.h"

namespace voxeld {
namespace {

using test::ByteWriter;
using test::load_text;
using test::MapBundle;
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

struct ReadColors {
  std::vector<std::vector<int>> bytes;  // red, green, blue in sRGB, and alpha
  std::vector<std::string> warnings;
};
// Reads three vertices with properties `names` of `type`.
ReadColors read_colors(const std::string& type, std::vector<std::string> names,
                       const std::vector<std::string>& rows) {
  std::string properties, body;
  for (const std::string& name : names) properties += "property " + type + " " + name + "\n";
  const char* places[] = {"0 0 0 ", "1 0 0 ", "0 1 0 "};
  for (size_t i = 0; i < 3; ++i) body += places[i] + rows[i] + "\n";
  const auto scene = load_text("a.ply", ascii(properties, "", body + "3 0 1 2\n"));
  EXPECT_TRUE(scene) << scene.error().message();
  if (!scene) return {};
  test::expect_consistent(*scene);
  ReadColors read{{}, test::warnings_of(*scene)};
  for (const glm::vec4& color : scene->parts[0].colors) {
    std::vector<int>& bytes = read.bytes.emplace_back();
    for (int i = 0; i < 3; ++i) {
      const float c = color[i];
      const float srgb = c <= 0.0031308f ? 12.92f * c : 1.055f * std::pow(c, 1 / 2.4f) - 0.055f;
      bytes.push_back(static_cast<int>(std::lround(255 * srgb)));
    }
    bytes.push_back(static_cast<int>(std::lround(255 * color.w)));
  }
  return read;
}

TEST(Ply, the_largest_value_tells_the_range_of_colours) {
  using testing::ElementsAre;
  using testing::IsEmpty;
  const std::vector<std::string> rgb = {"red", "green", "blue"};
  const struct {
    const char* type;
    std::vector<std::string> rows;
    std::vector<int> last;
    const char* warning;  // its end
  } cases[] = {{"uchar", {"0 0 0", "1 1 1", "0 1 1"}, {0, 1, 1, 255}, ""},
               {"uchar", {"0 0 0", "255 0 0", "128 64 255"}, {128, 64, 255, 255}, ""},
               {"char", {"0 0 0", "-1 0 0", "-128 64 -1"}, {128, 64, 255, 255}, ""},
               {"int", {"0 0 0", "200 0 0", "128 64 100"}, {128, 64, 100, 255}, ""},
               {"float",
                {"0 0 0", "nan 0 0", "0.501961 0.250980 1.0"},
                {128, 64, 255, 255},
                "0 to 1, not 0 to 255, as the largest is 1"},
               {"double",
                {"0 0 0", "0.5 0 -1", "1.0625 0 0"},
                {255, 0, 0, 255},
                "0 to 1, not 0 to 255, as the largest is 1.062500"},
               {"float",
                {"0 0 0", "0 0 0", "128.0 0.5 0.0"},
                {128, 1, 0, 255},
                "0 to 255, not 0 to 1, as the largest is 128"},
               {"float",
                {"0 0 0", "255 0 0", "128 64 300"},
                {128, 64, 255, 255},
                "0 to 255, not 0 to 1, as the largest is 300"},
               {"ushort", {"0 0 0", "65535 0 0", "32896 16448 65535"}, {128, 64, 255, 255}, ""},
               {"short", {"0 0 0", "32767 0 0", "16448 8224 32767"}, {128, 64, 255, 255}, ""},
               {"ushort",
                {"0 0 0", "255 0 0", "128 64 255"},
                {128, 64, 255, 255},
                "0 to 255, not 0 to 65535, as the largest is 255"},
               {"uint",
                {"0 0 0", "65535 0 0", "32896 16448 65535"},
                {128, 64, 255, 255},
                "0 to 65535, not 0 to 255, as the largest is 65535"}};
  for (const auto& [type, rows, last, warning] : cases) {
    const ReadColors read = read_colors(type, rgb, rows);
    ASSERT_EQ(read.bytes.size(), 3u) << type;
    EXPECT_EQ(read.bytes[2], last) << type << " " << rows[2];
    if (*warning == '\0') {
      EXPECT_THAT(read.warnings, IsEmpty()) << type;
    } else {
      EXPECT_THAT(read.warnings,
                  ElementsAre(testing::AllOf(
                      testing::StartsWith("color-range: a.ply: range of vertex colours (sRGB): "),
                      testing::EndsWith(warning))));
    }
  }
}

TEST(Ply, alpha_has_a_range_of_its_own) {
  const ReadColors read =
      read_colors("float", {"r", "g", "b", "a"}, {"255 0 0 1", "0 255 0 0.5", "0 0 255 0"});
  EXPECT_THAT(read.bytes,
              testing::ElementsAre(std::vector{255, 0, 0, 255}, std::vector{0, 255, 0, 128},
                                   std::vector{0, 0, 255, 0}));
  EXPECT_THAT(
      read.warnings,
      testing::ElementsAre(
          "color-range: a.ply: range of vertex colours (sRGB): 0 to 255, not 0 to 1, as the "
          "largest is 255",
          "color-range: a.ply: range of vertex alpha: 0 to 1, not 0 to 255, as the largest is 1"));
}

TEST(Ply, colours_have_many_names) {
  const std::vector<std::string> rows = {"0 0 0", "0 0 0", "255 128 64"};
  for (const std::vector<std::string>& names : {std::vector<std::string>{"red", "green", "blue"},
                                                {"r", "g", "b"},
                                                {"Red", "Green", "Blue"},
                                                {"diffuse_red", "diffuse_green", "diffuse_blue"}}) {
    EXPECT_EQ(read_colors("uchar", names, rows).bytes.at(2), (std::vector{255, 128, 64, 255}));
  }
  for (const char* name : {"grey", "gray", "luminance", "intensity"}) {
    EXPECT_EQ(read_colors("uchar", {name}, {"0", "255", "100"}).bytes.at(2),
              (std::vector{100, 100, 100, 255}));
  }
  EXPECT_EQ(read_colors("ushort", {"Intensity"}, {"0", "65535", "32896"}).bytes.at(2),
            (std::vector{128, 128, 128, 255}));
  EXPECT_EQ(read_colors("uchar", {"grey", "alpha"}, {"0 9", "9 9", "100 51"}).bytes.at(2),
            (std::vector{100, 100, 100, 51}));
  EXPECT_THAT(read_colors("float", {"intensity"}, {"0.5", "0.5", "0.5"}).bytes, testing::IsEmpty())
      << "a property of Stanford's scans";
}

TEST(Ply, normals_without_direction_are_those_of_triangles) {
  using testing::ElementsAre;
  const auto load = [](const std::string& body) {
    return load_text("a.ply", ascii("property float nx\nproperty float ny\nproperty float nz\n", "",
                                    body + "3 0 1 2\n", 4));
  };
  const glm::vec3 up(0, 0, 1), side(1, 0, 0);
  const auto some = load("0 0 0 2 0 0\n1 0 0 0 0 0\n0 1 0 1 0 0\n9 9 9 0 0 0\n");
  ASSERT_TRUE(some) << some.error().message();
  EXPECT_THAT(some->parts[0].normals, ElementsAre(side, up, side, up));
  EXPECT_THAT(test::warnings_of(*some), testing::IsEmpty());
  const auto broken = load("0 0 0 2 0 0\n1 0 0 nan 0 1\n0 1 0 1e35 0 0\n9 9 9 1 0 0\n");
  ASSERT_TRUE(broken) << broken.error().message();
  EXPECT_THAT(broken->parts[0].normals, ElementsAre(side, up, up, side));
  EXPECT_THAT(test::warnings_of(*broken),
              ElementsAre("dropped-attribute: a.ply: 2 normals are not finite (first: line 14); "
                          "those of triangles are used"));
  const auto none = load("0 0 0 0 0 0\n1 0 0 0 0 0\n0 1 0 0 0 0\n9 9 9 0 0 0\n");
  ASSERT_TRUE(none) << none.error().message();
  EXPECT_THAT(none->parts[0].normals, testing::IsEmpty());
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

TEST(Ply, this_in_the_name_of_a_texture_is_the_name_of_the_file) {
  std::string text = ascii("property float u\nproperty float v\n", "",
                           "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n");
  text.insert(text.find("element"), "comment TEXTUREFILE <this>_<This>.png\n");
  MapBundle bundle;
  bundle.add("scans/b.head.ply", text);
  const auto scene = load_scene("", bundle, {.decode_images = false});
  ASSERT_TRUE(scene) << scene.error().message();
  ASSERT_EQ(scene->materials.size(), 1u);
  EXPECT_EQ(scene->materials[0].name, "b.head_b.head.png");
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

TEST(Ply, faces_of_texture_number_minus_1_keep_their_colours) {
  std::string text = ascii("",
                           "property list uchar float texcoord\nproperty int texnumber\n"
                           "property uchar red\nproperty uchar green\nproperty uchar blue\n",
                           "0 0 0\n1 0 0\n1 1 0\n3 0 1 2 6 0 0 1 0 1 1 0 255 255 255\n"
                           "3 0 1 2 6 0 0 0 0 0 0 -1 0 255 0\n",
                           3, 2);
  text.insert(text.find("element"), "comment TextureFile a.png\n");
  MapBundle bundle;
  bundle.add("a.ply", text);
  bundle.add("a.png", "x");
  const auto scene = load_scene("", bundle, {.decode_images = false});
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  ASSERT_EQ(scene->parts.size(), 2u);
  EXPECT_EQ(scene->parts[0].material, 0);
  EXPECT_EQ(scene->parts[0].uvs.size(), 3u);
  EXPECT_THAT(scene->parts[0].colors, testing::IsEmpty());
  EXPECT_EQ(scene->parts[1].material, -1);
  EXPECT_THAT(scene->parts[1].uvs, testing::IsEmpty());
  EXPECT_THAT(scene->parts[1].colors, testing::Each(glm::vec4(0, 1, 0, 1)));
}

TEST(Ply, data_behind_the_last_element_is_left_out_with_a_warning) {
  const std::string text = ascii("", "", "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  const std::string binary = binary_ply(false);
  const std::string nul(1, '\0');
  for (const std::string& file : {text, binary}) {
    for (const std::string& rest : {std::string("\n"), std::string("\r\n \t\n"), "\n" + nul,
                                    nul + nul, std::string("\n\x1a")}) {
      const auto scene = load_text("a.ply", file + rest);
      ASSERT_TRUE(scene) << scene.error().message();
      EXPECT_THAT(test::warnings_of(*scene), testing::IsEmpty());
    }
  }
  for (const std::string& file : {text + "3 0 2 1", binary + nul + "1234567"}) {
    const auto scene = load_text("a.ply", file);
    ASSERT_TRUE(scene) << scene.error().message();
    EXPECT_THAT(test::warnings_of(*scene),
                testing::ElementsAre(
                    "trailing-bytes: a.ply: 8 bytes after the last element were left out"));
  }
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

// The corners of each triangle.
std::vector<std::vector<uint32_t>> triangles_of(const Scene& scene) {
  std::vector<std::vector<uint32_t>> triangles;
  const std::vector<uint32_t>& indices = scene.parts.at(0).indices;
  for (size_t i = 0; i + 2 < indices.size(); i += 3) {
    triangles.push_back({indices[i], indices[i + 1], indices[i + 2]});
  }
  return triangles;
}

// Strips or fans over a cube's corners; `rows` are the lists in text.
std::string strips_ply(const std::string& element, const std::string& type, int row_count,
                       const std::string& rows, const std::string& more = "") {
  return std::string("ply\nformat ascii 1.0\nelement vertex 8\n") + kXyz + "element " + element +
         " " + std::to_string(row_count) + "\nproperty list int " + type + " vertex_indices\n" +
         more + "end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n" + rows +
         "\n";
}

TEST(Ply, strips_become_triangles_of_one_side) {
  const std::vector<std::vector<uint32_t>> wanted = {
      {0, 1, 4}, {4, 1, 5}, {4, 5, 7}, {1, 2, 5}, {5, 2, 6}};
  for (const std::string& file :
       {strips_ply("tristrips", "int", 1, "10 0 1 4 5 7 -1 1 2 5 6"),
        strips_ply("tristrips", "int", 1, "11 0 1 4 5 7 -1 1 2 5 6 -1"),
        strips_ply("tristrips", "char", 1, "11 -1 0 1 4 5 7 -1 1 2 5 6"),
        strips_ply("tristrips", "uchar", 1, "10 0 1 4 5 7 255 1 2 5 6"),
        strips_ply("tristrips", "uint", 1, "10 0 1 4 5 7 4294967295 1 2 5 6"),
        strips_ply("tristrips", "int", 2, "5 0 1 4 5 7\n4 1 2 5 6"),
        // Repeated corners lead from one strip to the next.
        strips_ply("tristrips", "int", 1, "12 0 1 4 5 7 7 1 1 1 2 5 6")}) {
    const auto scene = load_text("a.ply", file);
    ASSERT_TRUE(scene) << scene.error().message();
    test::expect_consistent(*scene);
    EXPECT_EQ(triangles_of(*scene), wanted) << file;
    EXPECT_THAT(test::warnings_of(*scene), testing::IsEmpty());
  }
}

TEST(Ply, fans_become_triangles_around_their_first_corner) {
  const auto scene =
      load_text("a.ply", strips_ply("trifans", "int", 2, "7 0 1 2 3 -1 4 5\n3 5 6 7"));
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(triangles_of(*scene),
            (std::vector<std::vector<uint32_t>>{{0, 1, 2}, {0, 2, 3}, {5, 6, 7}}));
  EXPECT_THAT(test::warnings_of(*scene),
              testing::ElementsAre(
                  "skipped-faces: a.ply: 1 faces with fewer than 3 corners were left out"));
}

TEST(Ply, strips_follow_the_faces_and_their_attributes) {
  std::string file = strips_ply("tristrips", "int", 1, "4 0 1 3 2\n3 4 5 6 255 0 0 6 0 0 1 0 1 1 0",
                                std::string("element face 1\n") + kFaces +
                                    "property uchar red\nproperty uchar green\n"
                                    "property uchar blue\nproperty list uchar float texcoord\n"
                                    "property int texnumber\n");
  const auto scene = load_text("a.ply", file);
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  const MeshPart& part = scene->parts[0];
  EXPECT_EQ(part.positions[part.indices[0]], glm::dvec3(0, 0, 1));
  EXPECT_EQ(part.colors[part.indices[0]], glm::vec4(1, 0, 0, 1));
  EXPECT_EQ(part.colors[part.indices[8]], glm::vec4(1));
  EXPECT_EQ(part.uvs[part.indices[1]], glm::vec2(1, 1));
  EXPECT_EQ(scene->triangle_count(), 3u);
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
      {"ply\nformat ascii 1.0\nelement vertex 3\nelement face 1\n"
       "property list uchar int vertex_indices\nend_header\n3 0 1 2\n",
       "a.ply header: element vertex: expected properties x, y and z, got not all of them"},
      {std::string("ply\nformat ascii 1.0\nelement vertex 1\n") + kXyz +
           "element face 1\nproperty int n\nend_header\n0 0 0 1\n",
       "a.ply header: element face: expected a list property vertex_indices, got none"},
      {std::string("ply\nformat ascii 1.0\nelement vertex 1\n") + kXyz + "end_header\n0 0 0\n",
       "a.ply: the mesh is empty: expected at least one triangle, got no faces: a point cloud"},
      {std::string("ply\nformat ascii 1.0\nelement vertex 1\n") + kXyz +
           "element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n3 0 0 "
           "0\n",
       "a.ply: the mesh is empty: expected at least one triangle, got no faces"},
      {std::string("ply\nformat ascii 1.0\nelement vertex 1\n") + kXyz +
           "element tristrips 1\nproperty int n\nend_header\n0 0 0 1\n",
       "a.ply header: element tristrips: expected a list property vertex_indices, got none"}};
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
      {strips_ply("tristrips", "int", 1, "4 0 1 2 8"),
       "a.ply line 18: tristrips 0: vertex index out of range: expected 0..7, got 8"},
      {strips_ply("tristrips", "uchar", 1, "4 0 1 2 254"),
       "a.ply line 18: tristrips 0: vertex index out of range: expected 0..7, got 254"},
      {strips_ply("trifans", "int", 1, "4 0 1 2 -2"),
       "a.ply line 18: trifans 0: vertex index out of range: expected 0..7, got -2"},
      {strips_ply("tristrips", "int", 1, "4 0 1 2"),
       "a.ply line 19: tristrips 0: vertex_indices: expected a number, got the end of the file"},
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

TEST(Ply, an_alpha_that_is_0_everywhere_is_none) {
  for (const char* type : {"uchar", "float"}) {
    const ReadColors read =
        read_colors(type, {"red", "green", "blue", "alpha"}, {"1 0 0 0", "0 1 0 0", "0 0 1 0"});
    ASSERT_EQ(read.bytes.size(), 3u) << type;
    for (const std::vector<int>& color : read.bytes) EXPECT_EQ(color.at(3), 255) << type;
    EXPECT_THAT(read.warnings,
                testing::Contains("assumed-opaque: a.ply: alpha is 0 everywhere; the colours are "
                                  "taken as opaque"));
  }
}

// A binary triangle whose vertices have three more floats of these names.
std::string with_floats(std::string_view a, std::string_view b, std::string_view c) {
  std::string header = "ply\nformat binary_little_endian 1.0\nelement vertex 3\n";
  header += kXyz;
  for (const std::string_view name : {a, b, c}) {
    header += "property float " + std::string(name) + "\n";
  }
  ByteWriter w(false);
  w.text(header + "element face 1\n" + kFaces + "end_header\n");
  for (int i = 0; i < 3; ++i) {
    w.add(i == 1 ? 1.0f : 0.0f).add(i == 2 ? 1.0f : 0.0f).add(0.0f);
    w.add(0.5f).add(0.25f).add(0.125f);
  }
  w.add(uint8_t{3}).add(int32_t{0}).add(int32_t{1}).add(int32_t{2});
  return w.bytes();
}

TEST(Ply, attributes_take_the_room_of_the_vertices_that_the_header_declares) {
  const auto colored = load_text("a.ply", with_floats("red", "green", "blue"));
  ASSERT_TRUE(colored) << colored.error().message();
  EXPECT_EQ(colored->parts[0].colors.capacity(), 3u);
  const auto shaded = load_text("a.ply", with_floats("nx", "ny", "nz"));
  ASSERT_TRUE(shaded) << shaded.error().message();
  EXPECT_EQ(shaded->parts[0].normals.capacity(), 3u);
}

TEST(Ply, each_colour_and_normal_can_be_cancelled) {
  const auto points = [](const std::string& file) {
    return test::points_passed([&] { EXPECT_TRUE(load_text("a.ply", file).ok()); });
  };
  const int plain = points(with_floats("i", "j", "k"));
  EXPECT_GE(points(with_floats("red", "green", "blue")), plain + 2 * 3);
  EXPECT_GE(points(with_floats("nx", "ny", "nz")), plain + 3);
}

}  // namespace
}  // namespace voxeld
