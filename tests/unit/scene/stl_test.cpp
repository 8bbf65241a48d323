#include "server/scene/stl/stl.h"

#include <gmock/gmock.h>

#include <limits>

#include "server/scene/core/vertex_table.h"
#include "tests/unit/base/points_passed.h"
#include "tests/unit/scene/scene_test_util.h"

namespace voxeld {
namespace {

using test::ByteWriter;
using test::load_text;
using test::message_of;

struct Facet {
  float corners[9];
  uint16_t attribute = 0;
};
constexpr Facet kLeft = {{0, 0, 0, 1, 0, 0, 0, 1, 0}};
constexpr Facet kRight = {{1, 0, 0, 1, 1, 0, -0.0f, 1, 0}};

std::string stl_of(const std::vector<Facet>& facets, std::string header = "") {
  header.resize(80);
  ByteWriter w;
  w.text(header).add(static_cast<uint32_t>(facets.size()));
  for (const Facet& facet : facets) {
    w.add(0.0f).add(0.0f).add(std::numeric_limits<float>::quiet_NaN());  // normals are dropped
    for (const float x : facet.corners) w.add(x);
    w.add(facet.attribute);
  }
  return w.bytes();
}

// The facet of kLeft as text. `loop_end`, `facet_end`: the lines that end them.
std::string facet_text(const std::string& loop_end = "endloop",
                       const std::string& facet_end = "endfacet") {
  return " facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n   vertex 0 1 0\n "
         " " +
         loop_end + "\n " + facet_end + "\n";
}

Facet colored(Facet facet, uint16_t attribute) {
  facet.attribute = attribute;
  return facet;
}

TEST(Stl, binary_vertices_are_welded) {
  const auto scene = load_text("a.stl", stl_of({kLeft, kRight}));
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  EXPECT_EQ(scene->vertex_count(), 4u) << "-0 and 0 are one place";
  EXPECT_EQ(scene->triangle_count(), 2u);
  EXPECT_TRUE(scene->parts[0].normals.empty());
  EXPECT_FALSE(scene->has_colors());
}

TEST(Stl, vertices_that_grow_can_be_cancelled) {
  constexpr uint32_t kFacets = 100;
  std::vector<Facet> facets;
  for (uint32_t i = 0; i < kFacets; ++i) {
    const auto z = static_cast<float>(i);
    facets.push_back({{0, 0, z, 1, 0, z, 0, 1, z}});
  }
  const std::string file = stl_of(facets);
  // The facets are looked at twice, and their vertices are put into a table.
  const int others = test::points_passed([] {
    VertexTable table(kFacets / 2);
    for (uint32_t i = 0; i < 3 * kFacets; ++i) (void)table.find_or_add({i, 0, 0, 0}, i);
  });
  const int all = test::points_passed(
      [&] { EXPECT_TRUE(load_stl_binary("a.stl", test::bytes_of(file)).ok()); });
  EXPECT_GE(all, others + static_cast<int>(2 * kFacets) + 5);
}

TEST(Stl, a_header_that_begins_with_solid_may_be_binary) {
  EXPECT_EQ(load_text("a.stl", stl_of({kLeft}, "solid by SomeCAD"))->triangle_count(), 1u);
}

TEST(Stl, trailing_bytes_are_a_warning) {
  const auto scene = load_text("a.stl", stl_of({kLeft}) + "xyz");
  ASSERT_TRUE(scene) << scene.error().message();
  ASSERT_EQ(scene->warnings.size(), 1u);
  EXPECT_EQ(scene->warnings[0].detail, "a.stl: 3 bytes after the 1 triangles were left out");
}

std::string stl_that_declares(uint32_t count, const std::vector<Facet>& facets,
                              const std::string& rest = "") {
  std::string bytes = stl_of(facets) + rest;
  for (size_t i = 0; i < 4; ++i) bytes[80 + i] = static_cast<char>(count >> 8 * i);
  return bytes;
}

TEST(Stl, the_size_wins_over_a_wrong_count_with_a_warning) {
  constexpr uint16_t kRed = 0x8000 | 31 << 10;
  const std::vector<Facet> facets = {kLeft, kRight, colored(kLeft, kRed)};
  for (const uint32_t count : {0u, 1u, 4u, 5000u, 0xffffffffu}) {
    const auto scene = load_text("a.stl", stl_that_declares(count, facets));
    ASSERT_TRUE(scene) << scene.error().message();
    test::expect_consistent(*scene);
    EXPECT_EQ(scene->triangle_count(), 3u);
    EXPECT_TRUE(scene->has_colors());
    EXPECT_THAT(
        test::warnings_of(*scene),
        testing::ElementsAre("triangle-count: a.stl: the header declares " + std::to_string(count) +
                             " triangles, the size is that of 3, which were read"));
    const auto unnamed = load_text("", stl_that_declares(count, facets));
    ASSERT_TRUE(unnamed) << unnamed.error().message();
    EXPECT_EQ(unnamed->triangle_count(), 3u);
  }
}

TEST(Stl, no_name_and_a_wrong_count_need_triangles_alone) {
  const std::string bytes = stl_that_declares(0, {kLeft, kRight});
  for (const std::string& other : {bytes + std::string(50, 'x'), bytes + "x", bytes.substr(0, 84),
                                   bytes.substr(0, 83), std::string(84, 'a') + bytes.substr(84)}) {
    EXPECT_THAT(message_of(load_text("", other)), testing::HasSubstr("not a format that voxeld"))
        << other.size() << " bytes";
  }
}

TEST(Stl, rubbish_of_whole_triangles_behind_the_last_is_left_out) {
  for (const std::string& rubbish : {std::string(100, '\0'), std::string(100, 'x'),
                                     stl_of({kLeft}).substr(84) + std::string(50, '\0')}) {
    const auto scene = load_text("a.stl", stl_that_declares(2, {kLeft, kRight}, rubbish));
    ASSERT_TRUE(scene) << scene.error().message();
    EXPECT_EQ(scene->triangle_count(), 2u);
    EXPECT_THAT(test::warnings_of(*scene),
                testing::ElementsAre("trailing-bytes: a.stl: 100 bytes after the 2 triangles were "
                                     "left out"));
  }
}

TEST(Stl, viscam_colours_are_bgr_with_the_top_bit) {
  const auto scene =
      load_text("a.stl", stl_of({colored(kLeft, 0x8000 | 31 << 10), colored(kRight, 31)}));
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  const MeshPart& part = scene->parts[0];
  EXPECT_EQ(part.positions.size(), 6u) << "other colour, other vertex";
  EXPECT_EQ(part.colors[part.indices[0]], glm::vec4(1, 0, 0, 1));
  EXPECT_EQ(part.colors[part.indices[3]], glm::vec4(1, 1, 1, 1)) << "without the bit: no colour";
}

TEST(Stl, magics_colours_are_rgb_without_the_top_bit) {
  const auto scene =
      load_text("a.stl", stl_of({colored(kLeft, 31), colored(kRight, 0x8000)},
                                "COLOR=" + std::string("\x00\xff\x00\xff", 4) + ",MATERIAL="));
  ASSERT_TRUE(scene) << scene.error().message();
  const MeshPart& part = scene->parts[0];
  EXPECT_EQ(part.colors[part.indices[0]], glm::vec4(1, 0, 0, 1));
  EXPECT_EQ(part.colors[part.indices[3]], glm::vec4(0, 1, 0, 1)) << "the object's colour";
}

TEST(Stl, text_makes_a_part_of_each_solid) {
  const auto scene = load_text(
      "a.stl",
      "solid left part\nfacet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n"
      "  vertex 0 1 0\n endloop\nendfacet\nendsolid left part\n\nsolid empty\nendsolid\n"
      "SOLID\r\nFACET NORMAL nan nan nan\r\nOUTER LOOP\r\nVERTEX 1 0 0\r\nVERTEX 1 1 0\r\n"
      "VERTEX 0 1e0 0\r\nENDLOOP\r\nENDFACET\r\nendsolid\r\n");
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  ASSERT_EQ(scene->parts.size(), 2u);
  EXPECT_EQ(scene->parts[0].name, "left part");
  EXPECT_EQ(scene->parts[1].name, "");
  EXPECT_THAT(scene->meshes, testing::ElementsAre("left part", ""));
  EXPECT_THAT(test::origins_of(*scene), testing::ElementsAre("left part | left part | ", " |  | "));
}

TEST(Stl, more_solids_than_parts_may_be_go_together) {
  std::string text;
  for (int i = 0; i < 65'540; ++i) {
    text +=
        "solid s\nfacet normal 0 0 1 outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 1 0 endloop "
        "endfacet endsolid\n";
  }
  const auto scene = load_text("a.stl", text);
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->parts.size(), 65'536u);
  EXPECT_EQ(scene->meshes.size(), 65'536u) << "solids of one name are several";
  EXPECT_EQ(scene->triangle_count(), 65'540u);
  EXPECT_TRUE(scene->parts_merged);
}

TEST(Stl, text_and_binary_of_one_mesh_are_the_same_vertices) {
  const auto text = load_text("a.stl",
                              "solid\nfacet normal 0 0 1 outer loop vertex 0.125 -0 0 vertex 1 0 0 "
                              "vertex 0 3.75e-1 0 endloop endfacet endsolid");
  const auto bytes = load_text("a.stl", stl_of({{{0.125f, 0, 0, 1, 0, 0, 0, 0.375f, 0}}}));
  ASSERT_TRUE(text) << text.error().message();
  ASSERT_TRUE(bytes) << bytes.error().message();
  EXPECT_EQ(text->parts[0].positions, bytes->parts[0].positions);
}

TEST(Stl, text_keeps_the_digits_of_places_far_from_the_origin) {
  const auto scene = load_text(
      "a.stl",
      "solid\nfacet normal 0 0 1\nouter loop\nvertex -2487003.578125 -4684680.453125 3529638\n"
      "vertex -2487004.078125 -4684680.890625 3529638.484375\n"
      "vertex -2487003.5781250 -4684680.453126 3529638\nendloop\nendfacet\n"
      "facet normal 0 0 1\nouter loop\nvertex -2487003.578125 -4684680.453125 3529638\n"
      "vertex -2487003.5781250 -4684680.453126 3529638.0\n"
      "vertex 0 0 0.1\nendloop\nendfacet\nendsolid\n");
  ASSERT_TRUE(scene) << scene.error().message();
  const MeshPart& part = scene->parts[0];
  EXPECT_THAT(part.positions,
              testing::ElementsAre(glm::dvec3(-2487003.578125, -4684680.453125, 3529638),
                                   glm::dvec3(-2487004.078125, -4684680.890625, 3529638.484375),
                                   glm::dvec3(-2487003.578125, -4684680.453126, 3529638),
                                   glm::dvec3(0, 0, 0.1)));
  EXPECT_THAT(part.indices, testing::ElementsAre(0, 1, 2, 0, 2, 3));
}

TEST(Stl, text_is_read_as_many_programs_write_it) {
  const std::string facet = facet_text();
  const std::string files[] = {
      "solid a\n" + facet_text("end loop") + "endsolid a\n",
      "solid a\n" + facet_text("end loop", "end facet") + "end solid a\n",
      "SOLID A\n" + facet_text("END LOOP", "END FACET") + "END SOLID A\n",
      "solid a\n" + facet + "end solid solid a of facet models\n",
      "solid a\nsolid a\n" + facet + "endsolid a\n",
      "solid a\n" + facet + "endsolid a\nendsolid a\n",
      "solid a\n" + facet + "endsolid a\nend solid\nendsolid\n",
      "solid a of facet models\n" + facet + "endsolid\n",
      facet + "endsolid\n",
      "solid a facet normal 0 0 1 outerloop vertex 0 0 0 vertex 1 0 0 vertex 0 1 0 end\nloop "
      "endfacet endsolid a",
      "solid a\nfacet\nouter loop\nvertex 0.D+00 0.0D0 0d0 vertex 1.0D+00 0 0 vertex 0 "
      "0.1d+1 0 endloop endfacet endsolid a"};
  for (const std::string& text : files) {
    const auto scene = load_text("a.stl", text);
    ASSERT_TRUE(scene) << text << scene.error().message();
    ASSERT_EQ(scene->parts.size(), 1u) << text;
    EXPECT_THAT(scene->parts[0].positions,
                testing::ElementsAre(glm::dvec3(0), glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0)))
        << text;
    EXPECT_THAT(test::warnings_of(*scene), testing::IsEmpty()) << text;
  }
}

TEST(Stl, solids_on_one_line_keep_their_names) {
  const std::string facet =
      "facet normal 0 0 1 outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 1 0 endloop endfacet ";
  const auto scene = load_text("a.stl", "solid one " + facet + "endsolid one solid the other " +
                                            facet + "end solid the other solid " + facet);
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_THAT(scene->meshes, testing::ElementsAre("one", "the other", ""));
}

TEST(Stl, other_words_between_facets_are_left_out_with_a_warning) {
  const auto scene =
      load_text("a.stl", "solid a\nunits mm\n" + facet_text("endloop", "endfacet attribute 7") +
                             facet_text("endloop", "endfacet\n endfacet") + "endsolid a\n");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->triangle_count(), 2u);
  EXPECT_FALSE(scene->has_colors());
  EXPECT_THAT(
      test::warnings_of(*scene),
      testing::ElementsAre("ignored-words: a.stl: 5 words between facets were left out, the "
                           "first in line 2: \"units\""));
}

TEST(Stl, the_colour_after_a_facet_is_that_of_a_binary_file) {
  const std::string files[] = {facet_text("endloop", "endfacet color 31744"),
                               facet_text("endloop", "endfacet\nCOLOR 32799\n"), facet_text(),
                               facet_text("endloop", "endfacet color 0.5 0 0"),
                               facet_text("endloop", "endfacet color 65536")};
  const glm::vec4 red(1, 0, 0, 1), blue(0, 0, 1, 1), white(1);
  for (const bool white_first : {false, true}) {
    const std::string first = white_first ? facet_text() : "";
    const auto scene = load_text("a.stl", "solid a\n" + first + files[0] + files[1] + files[2] +
                                              files[3] + files[4] + "endsolid a\n");
    ASSERT_TRUE(scene) << scene.error().message();
    test::expect_consistent(*scene);
    const MeshPart& part = scene->parts[0];
    std::vector<glm::vec4> colors;
    for (size_t i = 0; i < part.indices.size(); i += 3) {
      colors.push_back(part.colors.at(part.indices[i]));
    }
    std::vector<glm::vec4> wanted = {red, blue, white, white, white};
    if (white_first) wanted.insert(wanted.begin(), white);
    EXPECT_EQ(colors, wanted);
    EXPECT_EQ(part.positions.size(), 9u) << "facets of one colour share vertices";
    EXPECT_THAT(test::warnings_of(*scene),
                testing::ElementsAre("ignored-words: a.stl: 6 words between facets were left out, "
                                     "the first in line " +
                                     std::to_string(white_first ? 38 : 31) + ": \"color\""));
  }
}

TEST(Stl, decimal_commas_are_read_with_a_warning) {
  const auto scene = load_text("a.stl",
                               "solid a\nfacet normal 0,0 0,0 1,0\nouter loop\nvertex 0,5 0,0 0\n"
                               "vertex 1,25e1 0,0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_THAT(
      scene->parts[0].positions,
      testing::ElementsAre(glm::dvec3(0.5, 0, 0), glm::dvec3(12.5, 0, 0), glm::dvec3(0, 1, 0)));
  EXPECT_THAT(test::warnings_of(*scene),
              testing::ElementsAre("decimal-commas: a.stl line 4: \"0,5\" and the like were read "
                                   "with a comma as the decimal point"));
}

TEST(Stl, a_text_without_its_last_line_is_a_warning) {
  const auto scene = load_text("a.stl", "solid a\n" + facet_text());
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->triangle_count(), 1u);
  EXPECT_THAT(test::warnings_of(*scene),
              testing::ElementsAre("missing-end: a.stl: no \"endsolid\" after the last of 1 "
                                   "facets: the file may be cut off"));
}

TEST(Stl, mistakes_are_reported) {
  constexpr Facet kNan = {{0, 0, 0, 1, std::numeric_limits<float>::infinity(), 0, 0, 1, 0}};
  const std::string huge = stl_that_declares(0xffffffff, {kLeft}, "x");
  const std::string lying = stl_that_declares(9, {kLeft}, "x");
  const std::pair<std::string, const char*> cases[] = {
      {"",
       "a.stl: neither text nor binary STL: expected \"solid\", or 80 bytes of header and the "
       "number of triangles, got no bytes"},
      {"solidity\n",
       "a.stl: neither text nor binary STL: expected \"solid\", or 80 bytes of header and the "
       "number of triangles, got 9 bytes that begin with \"solidity\\x0a\""},
      // As binary, text has a triangle count of 543,973,741, or 169,877,536 if byte 83 ends a line.
      {std::string(80, 'x') + "mal " + std::string(500, 'x'),
       "a.stl: neither text nor binary STL: expected \"solid\", or 80 bytes of header and the "
       "number of triangles, got 584 bytes that begin with \"xxxxxxxxxxxxxxxx\""},
      {std::string(80, 'x') + "   \n" + std::string(500, 'x'),
       "a.stl: neither text nor binary STL: expected \"solid\", or 80 bytes of header and the "
       "number of triangles, got 584 bytes that begin with \"xxxxxxxxxxxxxxxx\""},
      {"\x89PNG\r\n\x1a\n" + std::string(72, '\0') + "\x89\xab\xcd\xef" + std::string(99, '\0'),
       "a.stl: neither text nor binary STL: expected \"solid\", or 80 bytes of header and the "
       "number of triangles, got 183 bytes that begin with "
       "\"\\x89PNG\\x0d\\x0a\\x1a\\x0a\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\""},
      {stl_of({}), "a.stl: the mesh is empty: expected at least one triangle, got no triangles"},
      {lying, "a.stl byte 80: truncated: 9 triangles declared: expected 534 bytes, got 135"},
      {huge,
       "a.stl: neither text nor binary STL: expected \"solid\", or 80 bytes of header and the "
       "number of triangles, got 135 bytes that begin with "
       "\"\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\""},
      {stl_that_declares(0xffffffff, {kNan}),
       "a.stl: neither text nor binary STL: expected \"solid\", or 80 bytes of header and the "
       "number of triangles, got 134 bytes that begin with "
       "\"\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\""},
      {stl_of({kLeft, kNan}),
       "a.stl triangle 1: vertex coordinate: expected a finite number up to 1e30, got inf"},
      {"solid x\nendsolid x\n",
       "a.stl: the mesh is empty: expected at least one triangle, got no facets"},
      {"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 zero\n",
       "a.stl line 4: vertex coordinate: expected a finite number up to 1e30, got \"zero\""},
      {"solid x\nfacet normal 0 0 1\nvertex 0 0 0\n",
       "a.stl line 3: wrong word: expected \"outer\", got \"vertex\""},
      {"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 0 0 0\nvertex 0 0 0\n"
       "vertex 0 0 0\n",
       "a.stl line 7: wrong word: expected \"endloop\", got \"vertex\""},
      {"solid x\nfacet normal 0 0 1\nouter loop\n",
       "a.stl line 4: wrong word: expected \"vertex\", got the end of the file"},
      {"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 1,2,3\n",
       "a.stl line 4: vertex coordinate: expected a finite number up to 1e30, got \"1,2,3\""},
      {"solid x\nvertex 0 0 0\n",
       "a.stl line 2: wrong word: expected \"facet\" or \"endsolid\", got \"vertex\""},
      {"solid x\nv 0 0 0\n",
       "a.stl line 2: wrong word: expected \"facet\" or \"endsolid\", got \"v\""},
      {"solid x\n" + facet_text("endloop", "") + "endsolid x\n",
       "a.stl line 9: wrong word: expected \"endfacet\", got \"endsolid\""},
      {"solid x\n",
       "a.stl line 2: wrong word: expected \"facet\" or \"endsolid\", got the end of "
       "the file"}};
  for (const auto& [bytes, message] : cases) {
    EXPECT_EQ(message_of(load_text("a.stl", bytes)), message);
  }
}

TEST(Stl, every_truncation_is_an_error_or_a_mesh) {
  test::expect_truncations_survive("a.stl", stl_of({kLeft, colored(kRight, 0x8001)}));
  test::expect_truncations_survive("a.stl",
                                   "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n"
                                   "vertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n");
  const std::string whole = stl_of({kLeft, kRight});
  for (size_t size = 0; size < whole.size(); ++size) {
    const bool is_whole_triangle = size == 134;
    EXPECT_EQ(bool(load_text("a.stl", whole.substr(0, size))), is_whole_triangle) << size;
  }
}

}  // namespace
}  // namespace voxeld
