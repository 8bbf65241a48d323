#include <gmock/gmock.h>

#include <bit>
#include <functional>
#include <random>

#include "server/scene/core/color_space.h"
#include "tests/unit/scene/scene_test_util.h"

namespace voxeld {
namespace {

using test::load_text;
using test::message_of;

constexpr char kBody[] = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

TEST(Off, keyword_and_counts_stand_in_any_way) {
  for (const char* head : {"OFF\n4 1 0\n", "OFF 4 1 0\n", "OFF4 1 0\n",
                           "# hi\nOFF # yes\n\n4 1 # no\n", "4 1 0\n", "OFF\r\n4 1 5\r\n"}) {
    const auto scene = load_text("a.off", std::string(head) + kBody + "4 0 1 2 3\n");
    ASSERT_TRUE(scene) << head << scene.error().message();
    test::expect_consistent(*scene);
    EXPECT_EQ(scene->format, "off");
    EXPECT_DOUBLE_EQ(test::area_of(*scene), 1.0);
    EXPECT_FALSE(scene->has_colors());
  }
}

TEST(Off, prefixes_add_normals_colours_and_texture_coordinates) {
  const auto scene = load_text("a.off",
                               "STCNOFF\n3 1 0\n0 0 0 0 0 2 255 0 0 51 0 0\n"
                               "1 0 0 0 0 1 0 255 0 255 1 0\n0 1 0 0 0 1 0 0 255 255 0 1\n"
                               "3 0 1 2\n");
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  const MeshPart& part = scene->parts[0];
  EXPECT_EQ(part.normals[0], glm::vec3(0, 0, 1));
  EXPECT_EQ(part.colors[0], glm::vec4(1, 0, 0, 0.2f));
  EXPECT_EQ(part.uvs[2], glm::vec2(0, 0));
}

TEST(Off, vertex_colours_have_three_or_four_numbers_in_bytes_or_units) {
  const auto three =
      load_text("a.off", "COFF\n3 1 0\n0 0 0 255 0 0\n1 0 0 0 0 0\n0 1 0 0 0 0\n3 0 1 2\n");
  ASSERT_TRUE(three) << three.error().message();
  EXPECT_EQ(three->parts[0].colors[0], glm::vec4(1, 0, 0, 1));
  const auto unit = load_text(
      "a.off", "COFF\n3 1 0\n0 0 0 0.5 0 1 0.5\n1 0 0 0. 0 0 1\n0 1 0 0. 0 0 1\n3 0 1 2\n");
  ASSERT_TRUE(unit) << unit.error().message();
  EXPECT_NEAR(unit->parts[0].colors[0].x, 0.21404f, 1e-4f) << "sRGB, as the integers are";
  EXPECT_EQ(unit->parts[0].colors[0].w, 0.5f);
}

TEST(Off, face_colours_stay_on_their_faces) {
  const auto scene =
      load_text("a.off", std::string("OFF\n4 4 0\n") + kBody +
                             "3 0 1 2\n4 0 1 2 3 255 0 0\n3 0 1 2 0. 1. 0.\n3 1 2 3 7\n");
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  const MeshPart& part = scene->parts[0];
  ASSERT_EQ(part.colors.size(), 15u);
  EXPECT_EQ(part.colors[0], glm::vec4(1.0f)) << "no colour is white";
  EXPECT_EQ(part.colors[3], glm::vec4(1, 0, 0, 1));
  EXPECT_EQ(part.colors[8], glm::vec4(1, 0, 0, 1));
  EXPECT_EQ(part.colors[9], glm::vec4(0, 1, 0, 1));
  ASSERT_EQ(scene->warnings.size(), 1u);
  EXPECT_EQ(scene->warnings[0].code, "ignored-colors");
}

// A height field of 20 by 20 vertices whose lines end in `columns` of vertex i.
std::string height_field(std::string_view keyword, uint32_t seed, bool whole_heights,
                         const std::function<std::string(uint32_t i)>& columns) {
  constexpr uint32_t kSide = 20;
  std::minstd_rand random(seed);
  std::string text = std::string(keyword) + "\n400 722 0\n";
  for (uint32_t i = 0; i < kSide * kSide; ++i) {
    const auto height = static_cast<uint32_t>(random() % 20);
    text += std::to_string(i % kSide) + " " + std::to_string(i / kSide) + " " +
            (whole_heights ? std::to_string(height) : std::to_string(height / 7.0)) + columns(i) +
            "\n";
  }
  for (uint32_t y = 0; y + 1 < kSide; ++y) {
    for (uint32_t x = 0; x + 1 < kSide; ++x) {
      const uint32_t a = y * kSide + x;
      text += "3 " + std::to_string(a) + " " + std::to_string(a + 1) + " " +
              std::to_string(a + kSide) + "\n3 " + std::to_string(a + 1) + " " +
              std::to_string(a + kSide + 1) + " " + std::to_string(a + kSide) + "\n";
    }
  }
  return text;
}

std::string color_columns(uint32_t seed, size_t count, bool as_units) {
  std::minstd_rand random(seed);
  std::string text;
  for (size_t c = 0; c < count; ++c) {
    const auto byte = static_cast<uint32_t>(random() % 256);
    text += " " + (as_units ? std::to_string(byte / 255.0) : std::to_string(byte));
  }
  return text;
}

TEST(Off, colour_columns_under_any_keyword_are_colours_and_leave_the_geometry_alone) {
  for (uint32_t seed = 1; seed <= 60; ++seed) {
    const bool whole_heights = seed % 2 == 0, as_units = seed % 4 < 2;
    const size_t count = seed % 8 < 4 ? 3 : 4;
    SCOPED_TRACE("seed " + std::to_string(seed));
    const auto plain =
        load_text("a.off", height_field("OFF", seed, whole_heights, [](uint32_t) { return ""; }));
    ASSERT_TRUE(plain) << plain.error().message();
    for (const char* keyword : {"OFF", "COFF"}) {
      const auto colored =
          load_text("a.off", height_field(keyword, seed, whole_heights, [&](uint32_t i) {
                      return color_columns(seed + i, count, as_units);
                    }));
      ASSERT_TRUE(colored) << keyword << ": " << colored.error().message();
      test::expect_consistent(*colored);
      ASSERT_EQ(colored->parts[0].positions, plain->parts[0].positions) << keyword;
      ASSERT_EQ(colored->parts[0].indices, plain->parts[0].indices) << keyword;
      EXPECT_THAT(colored->warnings, testing::IsEmpty());
      ASSERT_EQ(colored->parts[0].colors.size(), 400u);
      std::minstd_rand random(seed + 7);
      const glm::vec4 color = colored->parts[0].colors[7];
      for (int c = 0; c < static_cast<int>(count); ++c) {
        const float srgb = static_cast<float>(random() % 256) / 255.0f;
        EXPECT_NEAR(color[c], c < 3 ? linear_from_srgb(glm::vec3(srgb)).x : srgb, 1e-5f);
      }
      if (count == 3) {
        EXPECT_EQ(color.w, 1.0f);
      }
    }
  }
}

TEST(Off, further_columns_that_are_no_colours_are_left_out_with_a_warning) {
  const auto plain = load_text("a.off", height_field("OFF", 5, true, [](uint32_t) { return ""; }));
  ASSERT_TRUE(plain) << plain.error().message();
  const std::pair<const char*, const char*> cases[] = {
      {"OFF", " 3"},         // an index
      {"OFF", " 0.5 0.25"},  // texture coordinates
      {"OFF", " 0 -1 0"},    // a normal
      {"OFF", " 0 256 0"},   // no byte
      {"OFF", " 1 1 1 1 1"},   {"OFF", " red green blue"},
      {"STOFF", " 0 0 1 1 1"},  // which of them are texture coordinates?
      {"COFF", " 1 1 1 1 7"}};
  for (const auto& [keyword, columns] : cases) {
    const auto scene = load_text(
        "a.off",
        height_field(keyword, 5, true, [text = std::string(columns)](uint32_t) { return text; }));
    ASSERT_TRUE(scene) << keyword << columns << ": " << scene.error().message();
    EXPECT_EQ(scene->parts[0].positions, plain->parts[0].positions) << columns;
    EXPECT_EQ(scene->parts[0].indices, plain->parts[0].indices) << columns;
    EXPECT_EQ(scene->has_colors(), keyword[0] == 'C') << columns;
    ASSERT_EQ(scene->warnings.size(), 1u) << columns;
    EXPECT_EQ(scene->warnings[0].code, "ignored-columns");
    EXPECT_EQ(scene->warnings[0].detail,
              "a.off: 400 vertices have columns that are no colour (first: line 3); they were "
              "left out");
  }
}

TEST(Off, some_vertices_may_have_colours_and_others_none) {
  const auto scene =
      load_text("a.off", "OFF\n3 1 0\n0 0 0 255 0 0\n1 0 0\n0 1 0 0 0 255 51\n3 0 1 2\n");
  ASSERT_TRUE(scene) << scene.error().message();
  const std::vector<glm::vec4>& colors = scene->parts[0].colors;
  ASSERT_EQ(colors.size(), 3u);
  EXPECT_EQ(colors[0], glm::vec4(1, 0, 0, 1));
  EXPECT_EQ(colors[1], glm::vec4(1.0f)) << "no colour is white";
  EXPECT_EQ(colors[2], glm::vec4(0, 0, 1, 0.2f));
}

// "1 0 0" among colours from 0 to 1 is red, among bytes nearly black.
TEST(Off, the_colours_of_a_file_tell_their_range_together) {
  const auto color_of = [](const std::string& first, const std::string& second) {
    const auto scene = load_text("a.off", "OFF\n3 1 0\n0 0 0 " + first + "\n1 0 0 " + second +
                                              "\n0 1 0 " + second + "\n3 0 1 2\n");
    EXPECT_TRUE(scene) << scene.error().message();
    return scene ? scene->parts[0].colors.at(0) : glm::vec4(-1.0f);
  };
  EXPECT_EQ(color_of("1 0 0", "0.5 0.5 0.5"), glm::vec4(1, 0, 0, 1));
  EXPECT_EQ(color_of("1 0 0 1", "0 1 0 1"), glm::vec4(1, 0, 0, 1));
  EXPECT_LT(color_of("1 0 0", "128 128 128").x, 0.001f);
  EXPECT_LT(color_of("1.0 0.0 0.0", "128.0 0.0 0.0").x, 0.001f);
  EXPECT_EQ(color_of("255.0 0.0 0.0", "1.0 0.0 0.0"), glm::vec4(1, 0, 0, 1));
}

TEST(Off, vertices_may_share_lines_or_take_several) {
  for (const char* vertices : {"0 0 0 1 0 0\n1 1 0 0 1 0\n", "0 0 0 1 0 0 1 1 0 0 1 0\n",
                               "0 0\n0 1 0\n0 1 1\n0 0\n1 0\n"}) {
    const auto scene =
        load_text("a.off", std::string("OFF\n4 2 0\n") + vertices + "3 0 1 2\n3 0 2 3\n");
    ASSERT_TRUE(scene) << vertices << scene.error().message();
    EXPECT_DOUBLE_EQ(test::area_of(*scene), 1.0) << vertices;
    EXPECT_FALSE(scene->has_colors());
  }
}

TEST(Off, corners_of_a_long_face_may_take_several_lines) {
  const auto scene = load_text("a.off", std::string("OFF\n4 1 0\n") + kBody + "4 0 1\n2 3\n");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_DOUBLE_EQ(test::area_of(*scene), 1.0);
}

TEST(Off, numbers_that_are_none_cost_a_normal_or_colour_alone) {
  const auto scene = load_text("a.off",
                               "CNOFF\n3 1 0\n0 0 0 nan nan -nan(ind) 255 0 0\n"
                               "1 0 0 0 0 1 nan 0 0\n0 1 0 0 0 1 0 0 255\n3 0 1 2\n");
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  EXPECT_EQ(scene->parts[0].normals[0], glm::vec3(0, 0, 1));
  EXPECT_EQ(scene->parts[0].colors[0], glm::vec4(1, 0, 0, 1));
  EXPECT_EQ(scene->parts[0].colors[1], glm::vec4(1.0f));
  ASSERT_EQ(scene->warnings.size(), 2u);
  EXPECT_EQ(scene->warnings[0].code, "dropped-attribute");
  EXPECT_EQ(scene->warnings[0].detail,
            "a.off: 1 normals are not finite (first: line 3); those of triangles are used");
  EXPECT_EQ(scene->warnings[1].detail,
            "a.off: 1 colours are not finite (first: line 4); they are taken as white");
}

TEST(Off, normals_without_direction_are_those_of_triangles) {
  const auto some = load_text("a.off",
                              "NOFF\n4 1 0\n0 0 0 2 0 0\n1 0 0 0 0 0\n0 1 0 1 0 0\n"
                              "9 9 9 0 0 0\n3 0 1 2\n");
  ASSERT_TRUE(some) << some.error().message();
  const glm::vec3 up(0, 0, 1), side(1, 0, 0);
  EXPECT_THAT(some->parts[0].normals, testing::ElementsAre(side, up, side, up));
  EXPECT_THAT(some->warnings, testing::IsEmpty());
  const auto none =
      load_text("a.off", "NOFF\n3 1 0\n0 0 0 0 0 0\n1 0 0 0 0 0\n0 1 0 0 0 0\n3 0 1 2\n");
  ASSERT_TRUE(none) << none.error().message();
  EXPECT_THAT(none->parts[0].normals, testing::IsEmpty());
}

// Big-endian, as Geomview writes it.
class BinaryOff {
 public:
  BinaryOff(std::string_view keyword, int32_t vertices, int32_t faces) {
    bytes_.text(keyword).text(" BINARY\n").add(vertices).add(faces).add(int32_t{0});
  }
  BinaryOff& floats(std::initializer_list<float> values) {
    for (const float value : values) bytes_.add(value);
    return *this;
  }
  BinaryOff& face(std::initializer_list<int32_t> corners, std::initializer_list<float> color = {}) {
    bytes_.add(static_cast<int32_t>(corners.size()));
    for (const int32_t corner : corners) bytes_.add(corner);
    bytes_.add(static_cast<int32_t>(color.size()));
    return floats(color);
  }
  BinaryOff& square() { return floats({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}); }
  const std::string& bytes() const { return bytes_.bytes(); }

 private:
  test::ByteWriter bytes_{true};
};

TEST(Off, binary_files_are_read) {
  const auto scene = load_text("a.off", BinaryOff("OFF", 4, 3)
                                            .square()
                                            .face({0, 1, 2, 3})
                                            .face({0, 1})
                                            .face({0, 1, 2}, {1, 0, 0, 0.5f})
                                            .bytes());
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  EXPECT_EQ(scene->format, "off");
  EXPECT_DOUBLE_EQ(test::area_of(*scene), 1.5);
  const MeshPart& part = scene->parts[0];
  EXPECT_EQ(part.colors.at(0), glm::vec4(1.0f));
  EXPECT_EQ(part.colors.at(6), glm::vec4(1, 0, 0, 0.5f));
  ASSERT_EQ(scene->warnings.size(), 1u);
  EXPECT_EQ(scene->warnings[0].code, "skipped-faces");
}

TEST(Off, binary_vertices_have_normals_colours_and_texture_coordinates) {
  const auto scene = load_text("", BinaryOff("# by hand\nSTCNOFF", 3, 1)
                                       .floats({0, 0, 0, 0, 0, 2, 1, 0, 0, 1, 0, 0})
                                       .floats({1, 0, 0, 0, 0, 1, 0, 1, 0, 1, 1, 0})
                                       .floats({0, 1, 0, 0, 0, 1, 0, 0, 1, 1, 0, 1})
                                       .face({0, 1, 2}, {7})
                                       .bytes());
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  const MeshPart& part = scene->parts[0];
  EXPECT_EQ(part.normals[0], glm::vec3(0, 0, 1));
  EXPECT_EQ(part.colors[1], glm::vec4(0, 1, 0, 1));
  EXPECT_EQ(part.uvs[2], glm::vec2(0, 0));
  EXPECT_EQ(scene->warnings.at(0).code, "ignored-colors");
}

// A carriage return, or any other byte of a line end, among the numbers is one of their bytes.
TEST(Off, bytes_of_binary_numbers_are_never_text) {
  const auto x = std::bit_cast<float>(uint32_t{0x3f0d1a23});  // '?', CR, ^Z, '#'
  const auto scene = load_text(
      "a.off", BinaryOff("OFF", 3, 1).floats({0, 0, 0, x, 0, 0, 0, 1, 0}).face({0, 1, 2}).bytes());
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->parts[0].positions[1].x, double{x});
}

TEST(Off, mistakes_of_binary_files_are_reported_with_their_byte) {
  const auto off = [](int32_t vertices, int32_t faces) {
    return BinaryOff("OFF", vertices, faces).square();
  };
  const std::string head = "OFF BINARY\n";
  const std::pair<std::string, const char*> cases[] = {
      {head, "a.off byte 11: truncated: the counts: expected 12 bytes, got 0 bytes left"},
      {"OFF BINARY 4\n", "a.off line 1: OFF BINARY: expected the end of the line, got \"4\""},
      {off(-4, 1).bytes(),
       "a.off byte 11: number of vertices: expected a whole number from 0, got -4"},
      {off(4, 200'000'001).bytes(),
       "a.off byte 15: too many faces: expected at most 200000000, got 200000001"},
      {off(100'000'000, 1).bytes(),
       "a.off byte 23: truncated: 100000000 vertices and 1 faces declared: expected at least "
       "1200000008 bytes, got 48 bytes left"},
      {off(4, 1).bytes(),
       "a.off byte 23: truncated: 4 vertices and 1 faces declared: expected at least 56 bytes, "
       "got 48 bytes left"},
      {off(4, 1).face({0, 1, 4}).bytes(),
       "a.off byte 83: face 0: vertex index out of range: expected 0..3, got 4"},
      {off(4, 1).face({0, 1, -1}).bytes(),
       "a.off byte 83: face 0: vertex index out of range: expected 0..3, got -1"},
      {off(4, 1).face({0, 1, 2}, {1, 1, 1, 1, 1}).bytes(),
       "a.off byte 87: face 0: number of colour components: expected 0 to 4, got 5"},
      {off(4, 1).face({0, 1, 2}).bytes() + "\n",
       "a.off byte 91: bytes after the last face: expected the end of the file, got 1 more"},
      {BinaryOff("OFF", 1, 0).floats({0, std::nanf(""), 0}).bytes(),
       "a.off byte 27: vertex 0: expected a finite number up to 1e30, got nan"},
      {BinaryOff("4OFF", 1, 0).bytes(),
       "a.off line 1: 4OFF: points with other than 3 coordinates: expected OFF with the "
       "prefixes ST, C and N, got 4OFF"}};
  for (const auto& [bytes, message] : cases) {
    EXPECT_EQ(message_of(load_text("a.off", bytes)), message);
  }
  const std::string whole = off(4, 2).face({0, 1, 2, 3}, {1, 1, 1}).face({0, 1, 2}, {0.5f}).bytes();
  test::expect_truncations_survive("a.off", whole);
  for (size_t size = 0; size < whole.size(); ++size) {
    EXPECT_FALSE(load_text("a.off", whole.substr(0, size))) << size;
  }
}

TEST(Off, faces_of_fewer_than_three_corners_are_left_out_with_a_warning) {
  const auto scene = load_text("a.off", std::string("OFF\n4 2 0\n") + kBody + "2 0 1\n3 0 1 2\n");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->triangle_count(), 1u);
  EXPECT_EQ(scene->warnings[0].code, "skipped-faces");
}

TEST(Off, mistakes_are_reported) {
  const std::string square = std::string("OFF\n4 1 0\n") + kBody;
  const std::pair<std::string, const char*> cases[] = {
      {"",
       "a.off line 1: number of vertices: expected a whole number from 0, got the end of the "
       "file"},
      {"hello", "a.off line 1: number of vertices: expected a whole number from 0, got \"hello\""},
      {"XOFF\n",
       "a.off line 1: wrong keyword: expected OFF with the prefixes ST, C and N, got "
       "\"XOFF\""},
      {"4OFF\n",
       "a.off line 1: 4OFF: points with other than 3 coordinates: expected OFF with the prefixes "
       "ST, C and N, got 4OFF"},
      {"nOFF\n",
       "a.off line 1: nOFF: points with other than 3 coordinates: expected OFF with the prefixes "
       "ST, C and N, got nOFF"},
      {"OFF\n3 -1 0\n",
       "a.off line 2: number of faces: expected a whole number from 0, got \"-1\""},
      {"OFF\n200000001 1 0\n",
       "a.off line 2: too many vertices: expected at most 200000000, got 200000001"},
      {"OFF\n3 200000001 0\n",
       "a.off line 2: too many faces: expected at most 200000000, got 200000001"},
      {"OFF\n100000000 100000000 0\n0 0 0\n",
       "a.off line 2: truncated: 100000000 vertices and 100000000 faces declared: expected at "
       "least "
       "800000000 bytes, got 7 bytes left"},
      {"OFF\n3 1 0\n0 0 0\n1 0 0\n0 nan 0\n3 0 1 2\n",
       "a.off line 5: vertex 2: expected a finite number up to 1e30, got \"nan\""},
      {square + "3 0 1 4\n",
       "a.off line 7: face 0: vertex index out of range: expected 0..3, got "
       "\"4\""},
      {square + "3 0 1 -1\n",
       "a.off line 7: face 0: vertex index out of range: expected 0..3, got "
       "\"-1\""},
      {square + "three\n", "a.off line 7: face 0: expected its number of corners, got \"three\""},
      {square + "65537 0 1 2\n",
       "a.off line 7: too many corners of a face: expected at most 65536, got 65537"},
      {square + "3 0 1\n",
       "a.off line 8: face 0: vertex index out of range: expected 0..3, got the "
       "end of the file"},
      {square + "3 0 1 2\n3 0 2 3\n",
       "a.off line 8: text after the last face: expected the end of the file, as the header "
       "declares 1 faces, got \"3\""},
      {std::string("OFF\n4 0 0\n") + kBody + "3 0 1 2\n",
       "a.off line 7: text after the last face: expected the end of the file, as the header "
       "declares 0 faces, got \"3\""},
      {"OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2\n",
       "a.off line 4: vertex 1: expected at least 3 numbers on its line, got 2"},
      {"COFF\n3 1 0\n0 0 0 1 1 1\n1 0 0 1\n0 1 0 1 1 1\n3 0 1 2\n",
       "a.off line 4: vertex 1: expected at least 6 numbers on its line, got 4"},
      {"COFF\n3 1 0\n0 0 0 1 1 red\n1 0 0 1 1 1\n0 1 0 1 1 1\n3 0 1 2\n",
       "a.off line 3: colour of vertex 0: expected numbers, got \"red\""},
      {"OFF\n0 1 0\n3 0 1 2\n",
       "a.off line 3: face 0: vertex index out of range: expected none, as there are no vertices, "
       "got \"0\""},
      {"OFF\n1 1 0\n0 0 0\n3 0 1 2\n",
       "a.off line 4: face 0: vertex index out of range: expected 0, got \"1\""},
      {square + "2 0 1\n",
       "a.off: the mesh is empty: expected at least one triangle, got no faces"},
      {std::string("OFF\n4 0 0\n") + kBody,
       "a.off: the mesh is empty: expected at least one triangle, got no faces"}};
  for (const auto& [text, message] : cases) {
    EXPECT_EQ(message_of(load_text("a.off", text)), message) << text;
  }
}

TEST(Off, unsupported_features_have_their_own_error_code) {
  EXPECT_EQ(load_text("a.off", "4OFF\n").error().code, ErrorCode::kUnsupportedFeature);
  EXPECT_EQ(load_text("a.off", "OFF\n0 0 0\n").error().code, ErrorCode::kEmptyMesh);
}

TEST(Off, every_truncation_is_an_error_or_a_mesh) {
  test::expect_truncations_survive(
      "a.off", std::string("COFF\n4 2 0\n0 0 0 1 2 3\n1 0 0 1 2 3\n1 1 0 1 2 3\n0 1 0 1 2 3\n"
                           "4 0 1 2 3 255 0 0\n3 0 1 2\n"));
}

}  // namespace
}  // namespace voxeld
