#include <gmock/gmock.h>

#include "proto/limits.h"
#include "tests/unit/base/points_passed.h"
#include "tests/unit/scene/scene_test_util.h"

namespace voxeld {
namespace {

using test::load_text;
using test::message_of;

constexpr char kSquare[] = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

TEST(Obj, all_forms_of_corners_are_read) {
  const auto scene = load_text("a.obj", std::string(kSquare) +
                                            "vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 2\n"
                                            "f 1 2 3\nf 1/1 2/2 3/3\nf 1//1 2//1 3//1\n"
                                            "f 1/1/1 2/2/1 3/3/1\nf -4/-3/-1 -3/-2/-1 -2/-1/-1\n");
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  // One part for each kind of corner; the last two faces are one kind, and share all vertices.
  ASSERT_EQ(scene->parts.size(), 4u);
  EXPECT_TRUE(scene->parts[0].uvs.empty());
  EXPECT_TRUE(scene->parts[0].normals.empty());
  EXPECT_EQ(scene->parts[1].uvs[0], glm::vec2(0, 1)) << "the bottom left is (0, 1) here";
  EXPECT_EQ(scene->parts[1].uvs[2], glm::vec2(1, 0));
  EXPECT_EQ(scene->parts[2].normals[0], glm::vec3(0, 0, 1));
  EXPECT_EQ(scene->parts[3].positions.size(), 3u);
  EXPECT_EQ(scene->parts[3].indices.size(), 6u);
}

TEST(Obj, vertices_are_shared_where_all_their_numbers_agree) {
  const auto scene = load_text("a.obj", std::string(kSquare) +
                                            "vt 0 0\nvt 1 1\nf 1/1 2/1 3/1\nf 1/1 3/1 4/1\n"
                                            "f 1/2 3/1 4/1\n");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->vertex_count(), 5u);
  EXPECT_EQ(scene->triangle_count(), 3u);
}

TEST(Obj, concave_polygons_keep_their_area) {
  const auto scene = load_text("a.obj",
                               "v 0 0 0\nv 6 0 0\nv 6 2 0\nv 2 2 0\nv 2 6 0\nv 0 6 0\n"
                               "f 1 2 3 4 5 6\n");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->triangle_count(), 4u);
  EXPECT_DOUBLE_EQ(test::area_of(*scene), 20.0);
}

TEST(Obj, triangles_that_repeat_a_corner_stay_as_segments) {
  EXPECT_EQ(load_text("a.obj", std::string(kSquare) + "f 1 2 2\n")->triangle_count(), 1u);
}

TEST(Obj, indices_may_point_forward) {
  EXPECT_EQ(load_text("a.obj", std::string("f 1 2 3 4\n") + kSquare)->triangle_count(), 2u);
}

TEST(Obj, continued_lines_carriage_returns_comments_and_a_byte_order_mark_are_read) {
  const auto scene = load_text("a.obj",
                               "\xef\xbb\xbf# made by hand\r\n\r\nv 0 0 0\r\nv 1 0 \\\r\n 0\r\n"
                               "v 1 1 0 # up\r\nf 1 2 \\\r\n3\r\n\tg x\r\nf 3 2 1 # back\\");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->triangle_count(), 2u);
}

TEST(Obj, faces_of_one_or_two_corners_are_left_out) {
  const auto scene = load_text("a.obj", std::string("l 1 2 3 4\nf 1\n") + kSquare +
                                            "usemtl wire\nl -1 -2\nf 1 2 # an edge\nf\np 3\n"
                                            "usemtl board\nf 1 2 3 4\nf 2/ 3/\n");
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  EXPECT_EQ(scene->triangle_count(), 2u);
  ASSERT_EQ(scene->parts.size(), 1u);
  ASSERT_GE(scene->warnings.size(), 1u);
  EXPECT_EQ(scene->warnings[0].code, "skipped-faces");
  EXPECT_EQ(scene->warnings[0].detail, "a.obj: 4 faces with fewer than 3 corners were left out");
}

TEST(Obj, a_backslash_continues_a_line_with_blanks_behind_it_but_not_a_comment) {
  const char* texts[] = {"f 1 2 \\ \t\n 3 \\\t\r\n4\n",          // blanks behind
                         "# in C:\\meshes\\\nf 1 2 3 4\n",       // a comment with a path
                         " # one \\\r\n# two \\ \nf 1 2 3 4\n",  // several of them
                         "f 1 2 3 4 # made in C:\\\nf 1 2\n"};   // one behind a statement
  for (const char* text : texts) {
    const auto scene = load_text("a.obj", std::string(kSquare) + text);
    ASSERT_TRUE(scene) << text << scene.error().message();
    EXPECT_EQ(scene->triangle_count(), 2u) << text;
  }
}

TEST(Obj, groups_and_objects_name_parts) {
  const auto scene = load_text("a.obj", std::string(kSquare) +
                                            "o left hand\nf 1 2 3\ng arm\nf 1 3 4\no left hand\n"
                                            "f 2 3 4\ng\nf 1 2 4\n");
  ASSERT_TRUE(scene) << scene.error().message();
  ASSERT_EQ(scene->parts.size(), 4u);
  EXPECT_EQ(scene->parts[0].name, "left hand");
  EXPECT_EQ(scene->parts[1].name, "arm");
  EXPECT_EQ(scene->parts[2].name, "left hand") << "still in group arm";
  EXPECT_EQ(scene->parts[3].name, "");
}

TEST(Obj, parts_know_their_object_and_their_group) {
  const auto scene = load_text("a.obj", std::string(kSquare) +
                                            "g late\ng first\nf 1 2 3\no body\nf 1 2 3\n"
                                            "g  arm \t left \nf 1 3 4\no head\ng first\nf 2 3 4\n"
                                            "o body\nf 1 2 4\ng arm left\nf 1 2 4\ng\nf 1 2 3\n");
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  EXPECT_THAT(scene->meshes, testing::ElementsAre("", "body", "head")) << "as faces use them";
  EXPECT_EQ(scene->nodes, scene->meshes);
  EXPECT_THAT(scene->groups, testing::ElementsAre("first", "arm left", ""));
  EXPECT_FALSE(scene->parts_merged);
  EXPECT_THAT(test::origins_of(*scene),
              testing::ElementsAre(" |  | first", "body | body | first", "body | body | arm left",
                                   "head | head | first", "body | body | "));
  EXPECT_EQ(scene->parts[1].indices.size(), 6u);
}

TEST(Obj, a_file_without_objects_and_groups_is_one_of_each) {
  const auto scene =
      load_text("a.obj", std::string(kSquare) + "usemtl a\nf 1 2 3\nusemtl b\nf 1 2 4\n");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_THAT(test::origins_of(*scene), testing::ElementsAre(" |  | ", " |  | "));
  EXPECT_EQ(scene->meshes.size() + scene->nodes.size() + scene->groups.size(), 3u);
}

TEST(Obj, more_groups_than_parts_may_be_go_together) {
  std::string text = kSquare;
  for (int i = 0; i < 70'000; ++i) text += "g g" + std::to_string(i) + "\nf 1 2 3\n";
  const auto scene = load_text("a.obj", text);
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->triangle_count(), 70'000u);
  EXPECT_LE(scene->parts.size(), 65'537u);
  EXPECT_TRUE(scene->parts_merged);
  test::expect_consistent(*scene);
}

TEST(Obj, as_many_groups_as_parts_may_be_stay_apart) {
  std::string text = kSquare;
  for (int i = 0; i < 65'535; ++i) text += "g g" + std::to_string(i) + "\nf 1 2 3\n";
  text += "g g7\nf 1 2 4\n";
  const auto scene = load_text("a.obj", text);
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->parts.size(), 65'535u);
  EXPECT_EQ(scene->groups.back(), "g65534");
  EXPECT_FALSE(scene->parts_merged);
}

// Few names of both kinds, but more pairs of them than parts.

TEST(Obj, more_pairs_of_object_and_group_than_parts_may_be_go_together) {
  std::string text = kSquare;
  for (int i = 0; i < 300; ++i) {
    text += "o o" + std::to_string(i) + "\n";
    for (int j = 0; j < 300; ++j) text += "g g" + std::to_string(j) + "\nf 1 2 3\n";
  }
  const auto scene = load_text("a.obj", text);
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->triangle_count(), 90'000u);
  EXPECT_LE(scene->parts.size(), 65'537u);
  EXPECT_TRUE(scene->parts_merged);
}

TEST(Obj, vertex_colours_are_srgb) {
  const auto scene = load_text("a.obj", "v 0 0 0 1 0.5 0\nv 1 0 0\nv 1 1 0 0 0 1 0.25\nf 1 2 3\n");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_TRUE(scene->has_colors());
  const auto& colors = scene->parts[0].colors;
  EXPECT_NEAR(colors[0].y, 0.21404f, 1e-4f);
  EXPECT_EQ(colors[1], glm::vec4(1.0f)) << "no colour is white";
  EXPECT_EQ(colors[2], glm::vec4(0, 0, 1, 0.25f));
}

TEST(Obj, vertex_colours_above_one_are_bytes) {
  const auto scene =
      load_text("a.obj", "v 0 0 0 255 0 0\nv 1 0 0 0 128 0\nv 1 1 0 1 1 1\nf 1 2 3\n");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->parts[0].colors[0], glm::vec4(1, 0, 0, 1));
  EXPECT_NEAR(scene->parts[0].colors[1].y, 0.2158605f, 1e-5f);
}

TEST(Obj, colours_of_zbrush_stand_in_comments) {
  const auto scene =
      load_text("a.obj", std::string(kSquare) +
                             "#MRGB ff800000ff00ff00\n#MRGB 000000ffffffffff\nf 1 2 3 4\n");
  ASSERT_TRUE(scene) << scene.error().message();
  const auto& colors = scene->parts[0].colors;
  ASSERT_EQ(colors.size(), 4u);
  EXPECT_NEAR(colors[0].x, 0.2158605f, 1e-5f);
  EXPECT_EQ(colors[1], glm::vec4(0, 1, 0, 1));
  EXPECT_EQ(colors[2], glm::vec4(0, 0, 1, 1)) << "a mask is no alpha";
  for (const char* other : {"#MRGB ff800000\n", "#MRGB ff80000\n", "# MRGB is a block\n"}) {
    EXPECT_FALSE(load_text("a.obj", std::string(kSquare) + other + "f 1 2 3\n")->has_colors());
  }
}

TEST(Obj, many_colours_in_one_line_can_be_cancelled) {
  constexpr int kColors = 100 * 4096;
  std::string text = std::string(kSquare) + "#MRGB ";
  text.append(size_t{8} * kColors, 'f').append("\nf 1 2 3 4\n");
  const auto load = [&] { EXPECT_TRUE(load_text("a.obj", text).ok()); };
  // Each 4096 colours, and each 64 KiB of the word.
  EXPECT_GE(test::points_passed(load), 100 + 8 * kColors / 65536);
}

TEST(Obj, a_keyword_of_more_than_80_bytes_is_no_statement) {
  const auto with_word = [](size_t bytes) {
    return load_text("a.obj", std::string(kSquare) + std::string(bytes, 'a') + " 1\nf 1 2 3 4\n");
  };
  EXPECT_TRUE(with_word(80).ok());
  EXPECT_NE(message_of(with_word(81)).find("not an OBJ statement"), std::string::npos);
}

TEST(Obj, a_weight_is_no_colour) {
  EXPECT_FALSE(load_text("a.obj", "v 0 0 0 1\nv 1 0 0 1\nv 1 1 0 1\nf 1 2 3\n")->has_colors());
}

TEST(Obj, statements_that_say_nothing_of_polygons_are_left_out) {
  const auto scene = load_text("a.obj", std::string(kSquare) +
                                            "s off\np 1\nl 1 2\nsurf 0 1\nsurf 0 1\n"
                                            "f 1 2 3\n");
  ASSERT_TRUE(scene) << scene.error().message();
  ASSERT_EQ(scene->warnings.size(), 1u);
  EXPECT_EQ(scene->warnings[0].code, "ignored-statement");
  EXPECT_EQ(scene->warnings[0].detail, "a.obj: statements \"surf\" were left out");
}

TEST(Obj, mistakes_are_reported_with_line_and_expectation) {
  struct Case {
    std::string text;
    const char* message;
  };
  const std::string square = kSquare;
  const Case cases[] = {
      {"v 0 0\n", "a.obj line 1: vertex: expected at least 3 numbers, got 2"},
      {"v 0 0 nan\n", "a.obj line 1: vertex: expected finite numbers up to 1e30, got \"nan\""},
      {"\nv 0 1e31 0\n", "a.obj line 2: vertex: expected finite numbers up to 1e30, got \"1e31\""},
      {"v 0 0 0 red\n", "a.obj line 1: vertex: expected finite numbers up to 1e30, got \"red\""},
      {"vt\n", "a.obj line 1: texture coordinate: expected at least 1 number, got 0"},
      {square + "f 1 2\nf\n",
       "a.obj: the mesh is empty: expected at least one triangle, got only faces of one or two "
       "corners"},
      {square + "f 1 2 9\n",
       "a.obj line 5: vertex index out of range: expected 1..4 or -4..-1, got 9"},
      {square + "f 1 2 -5\n",
       "a.obj line 5: vertex index out of range: expected 1..4 or -4..-1, got -5"},
      {square + "f 1 2 0\n",
       "a.obj line 5: vertex index: expected a number other than 0, got \"0\""},
      {square + "f 1 2 x\n",
       "a.obj line 5: vertex index: expected a number other than 0, got \"x\""},
      {square + "f 1 2 99999999999999999999\n",
       "a.obj line 5: vertex index: expected a number other than 0, got \"99999999999999999999\""},
      {square + "f 1 2 4294967295\n",
       "a.obj line 5: vertex index out of range: expected 1..4 or -4..-1, got 4294967295"},
      {square + "f 1 2 4294967296\n",
       "a.obj line 5: vertex index out of range: expected 1..4 or -4..-1, got 4294967296"},
      {"f -9 -2 -1\n",
       "a.obj line 1: vertex index out of range: expected none, as none are given, got -9"},
      {"v 0 0 0\nf 1 1 2\n", "a.obj line 2: vertex index out of range: expected 1 or -1, got 2"},
      {square + "f 1/x 2/x 3/x\n",
       "a.obj line 5: texture coordinate index: expected a number, got \"x\""},
      {square + "f 1//1z 2//1 3//1\n", "a.obj line 5: normal index: expected a number, got \"1z\""},
      {"v 0 0 0 1 0 red\n",
       "a.obj line 1: vertex: expected finite numbers up to 1e30, got \"red\""},
      {"v nan 0 0 1 0 0\n",
       "a.obj line 1: vertex: expected finite numbers up to 1e30, got \"nan\""},
      {"vt one\n",
       "a.obj line 1: texture coordinate: expected finite numbers up to 1e30, got \"one\""},
      {square + "f 1 2 \\\n\\\n 7\n",
       "a.obj line 5: vertex index out of range: expected 1..4 or -4..-1, got 7"},
      {square, "a.obj: the mesh is empty: expected at least one triangle, got no faces"},
      {"", "a.obj: the mesh is empty: expected at least one triangle, got no faces"},
      {"<html>\n",
       "a.obj line 1: not an OBJ statement: expected a keyword such as v or f, got "
       "\"<html>\""},
      {std::string("\x89PNG\0\1", 6),
       "a.obj line 1: not an OBJ statement: expected a keyword such as v or f, got "
       "\"\\x89PNG\\x00\\x01\""}};
  for (const Case& c : cases)
    EXPECT_EQ(message_of(load_text("a.obj", c.text)), c.message) << c.text;
}

// Exporters that drop unused coordinates leave such indices; the geometry is whole.

TEST(Obj, attributes_that_are_not_there_cost_the_face_its_attribute_alone) {
  const std::string square = kSquare;
  struct Case {
    std::string text;
    size_t uv_count, normal_count;  // of the parts together
    std::vector<std::string> warnings;
  };
  const Case cases[] = {
      {"vt 0 0\nf 1/1 2/1 3/2\nf 1/1 3/1 4/1\n",
       3,
       0,
       {"a.obj: 1 texture coordinate indices are out of range (first: line 6, expected 1 or -1, "
        "got 2); their faces have none"}},
      {"f 1//1 2//1 3//1\n",
       0,
       0,
       {"a.obj: 3 normal indices are out of range (first: line 5, expected none, as none are "
        "given, got 1); their faces have none"}},
      {"vt 0 0\nvt 0 0\nvn 0 0 1\nf 1/0/0 2/0/0 3/0/0\nf 1/-3/-2 3/1/1 4/2/1\n",
       0,
       0,
       {"a.obj: 4 texture coordinate indices are out of range (first: line 8, expected 1..2 or "
        "-2..-1, got 0); their faces have none",
        "a.obj: 4 normal indices are out of range (first: line 8, expected 1 or -1, got 0); their "
        "faces have none"}},
      {"vt 0 0\nf 1/99999999999999999999 2/4294967295 3/4294967296\n",
       0,
       0,
       {"a.obj: 3 texture coordinate indices are out of range (first: line 6, expected 1 or -1, "
        "got 99999999999999999999); their faces have none"}},
      {"vt nan 0\nvt 0 1e31\nvn nan nan nan\nvn 0 0 1\nvn 1.#QNAN -1.#IND 0\n"
       "f 1/1/2 2/1/2 3/1/2\nf 1/2/1 2/2/1 4/2/3\n",
       0,
       3,
       {"a.obj: 2 texture coordinates are not finite (first: line 5, got \"nan\"); their faces "
        "have none",
        "a.obj: 2 normals are not finite (first: line 7, got \"nan\"); their faces have none"}}};
  for (const Case& c : cases) {
    SCOPED_TRACE(c.text);
    const auto scene = load_text("a.obj", square + c.text);
    ASSERT_TRUE(scene) << scene.error().message();
    test::expect_consistent(*scene);
    size_t uv_count = 0, normal_count = 0;
    for (const MeshPart& part : scene->parts) {
      uv_count += part.uvs.size();
      normal_count += part.normals.size();
    }
    EXPECT_EQ(uv_count, c.uv_count);
    EXPECT_EQ(normal_count, c.normal_count);
    std::vector<std::string> warnings;
    for (const Warning& warning : scene->warnings) {
      EXPECT_EQ(warning.code, "dropped-attribute");
      warnings.push_back(warning.detail);
    }
    EXPECT_EQ(warnings, c.warnings);
  }
}

TEST(Obj, colours_that_are_not_finite_are_white) {
  const auto scene = load_text("a.obj",
                               "v 0 0 0 nan nan nan\nv 1 0 0 1 0 0\nv 1 1 0 0 -nan(ind) 0\n"
                               "v 0 1 0 0 0 1 inf\nf 1 2 3 4\n");
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  const auto& colors = scene->parts[0].colors;
  EXPECT_EQ(colors.at(0), glm::vec4(1.0f));
  EXPECT_EQ(colors.at(1), glm::vec4(1, 0, 0, 1));
  EXPECT_EQ(colors.at(2), glm::vec4(1.0f));
  EXPECT_EQ(colors.at(3), glm::vec4(1.0f));
  ASSERT_EQ(scene->warnings.size(), 1u);
  EXPECT_EQ(scene->warnings[0].detail,
            "a.obj: 3 colours of vertices are not finite (first: line 1, got \"nan\"); they are "
            "taken as white");
}

TEST(Obj, a_face_of_too_many_corners_is_refused) {
  std::string text = kSquare;
  text += "f";
  for (int i = 0; i <= limits::kPolygonCornersMax; ++i) text += " 1";
  EXPECT_EQ(message_of(load_text("a.obj", text)),
            "a.obj line 5: too many corners of a face: expected at most 65536, got 65537");
}

TEST(Obj, statements_of_more_than_4_mib_are_refused_but_comments_and_those_without_use) {
  const std::string zeros(size_t{4} << 20, '0');
  for (const char* first : {"#", "l "}) {
    EXPECT_TRUE(load_text("a.obj", first + zeros + "\n" + kSquare + "f 1 2 3\n").ok()) << first;
  }
  EXPECT_EQ(message_of(load_text("a.obj", kSquare + ("f 1 2 3" + zeros))),
            "a.obj line 5: too many bytes of a statement: expected at most 4194304, got 4194311");
  EXPECT_EQ(message_of(load_text("a.obj", kSquare + ("f 1 2 \\\n" + zeros))),
            "a.obj line 5: too many bytes of a statement: expected at most 4194304, got 4194311");
}

TEST(Obj, a_long_name_costs_each_part_little) {
  const std::string name(5000, 'x'), square = kSquare;
  const auto scene =
      load_text("a.obj", square + "o " + name + "\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 4\n");
  ASSERT_TRUE(scene) << scene.error().message();
  ASSERT_EQ(scene->parts.size(), 2u);
  for (const MeshPart& part : scene->parts) EXPECT_EQ(part.name, name.substr(0, 1024));
  EXPECT_EQ(scene->meshes, std::vector<std::string>{name});
  EXPECT_EQ(message_of(load_text("a.obj", square + "usemtl " + name + "\nf 1 2 3\n")),
            "a.obj line 5: too many bytes of a material's name: expected at most 4096, got 5000");
}

TEST(Obj, warnings_are_capped) {
  std::string text = kSquare;
  for (int i = 0; i < 500; ++i) text += "usemtl m" + std::to_string(i) + "\nf 1 2 3\n";
  const auto scene = load_text("a.obj", text);
  ASSERT_TRUE(scene) << scene.error().message();
  ASSERT_EQ(scene->warnings.size(), 100u);
  EXPECT_EQ(scene->warnings.back().code, "more-warnings");
}

TEST(Obj, every_truncation_is_an_error_or_a_mesh) {
  test::expect_truncations_survive(
      "a.obj", std::string(kSquare) + "vt 0 0\nvn 0 0 1\nusemtl a\nf 1/1/1 2/1/1 3/1/1 4/1/1\n");
}

}  // namespace
}  // namespace voxeld
