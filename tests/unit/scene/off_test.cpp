#include <gmock/gmock.h>

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

TEST(Off, faces_of_fewer_than_three_corners_are_left_out_with_a_warning) {
  const auto scene = load_text("a.off", std::string("OFF\n4 2 0\n") + kBody + "2 0 1\n3 0 1 2\n");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->triangle_count(), 1u);
  EXPECT_EQ(scene->warnings[0].code, "skipped-faces");
}

TEST(Off, mistakes_are_told) {
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
       "a.off line 1: 4OFF: points with other than 3 coordinates: expected OFF as text, "
       "with the prefixes ST, C and N"},
      {"nOFF\n",
       "a.off line 1: nOFF: points with other than 3 coordinates: expected OFF as text, "
       "with the prefixes ST, C and N"},
      {"OFF BINARY\n",
       "a.off line 1: OFF BINARY: expected OFF as text, with the prefixes ST, C and "
       "N"},
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
      {square + "2 0 1\n", "a.off: no faces"},
      {std::string("OFF\n4 0 0\n") + kBody, "a.off: no faces"}};
  for (const auto& [text, message] : cases) {
    EXPECT_EQ(message_of(load_text("a.off", text)), message) << text;
  }
}

TEST(Off, refusals_of_what_is_not_supported_have_their_own_code) {
  EXPECT_EQ(load_text("a.off", "4OFF\n").error().code, ErrorCode::kUnsupportedFeature);
  EXPECT_EQ(load_text("a.off", "OFF BINARY\n").error().code, ErrorCode::kUnsupportedFeature);
  EXPECT_EQ(load_text("a.off", "OFF\n0 0 0\n").error().code, ErrorCode::kEmptyMesh);
}

TEST(Off, every_truncation_is_an_error_or_a_mesh) {
  test::expect_truncations_survive(
      "a.off", std::string("COFF\n4 2 0\n0 0 0 1 2 3\n1 0 0 1 2 3\n1 1 0 1 2 3\n0 1 0 1 2 3\n"
                           "4 0 1 2 3 255 0 0\n3 0 1 2\n"));
}

}  // namespace
}  // namespace voxeld
