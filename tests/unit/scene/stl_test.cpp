#include "server/scene/stl/stl.h"

#include <gmock/gmock.h>

#include <limits>

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

TEST(Stl, a_header_that_begins_with_solid_may_be_binary) {
  EXPECT_EQ(load_text("a.stl", stl_of({kLeft}, "solid by SomeCAD"))->triangle_count(), 1u);
}

TEST(Stl, trailing_bytes_are_a_warning) {
  const auto scene = load_text("a.stl", stl_of({kLeft}) + "xyz");
  ASSERT_TRUE(scene) << scene.error().message();
  ASSERT_EQ(scene->warnings.size(), 1u);
  EXPECT_EQ(scene->warnings[0].detail, "a.stl: 3 bytes after the last triangle were left out");
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
                              "solid\nfacet normal 0 0 1 outer loop vertex 0.1 0 0 vertex 1 0 0 "
                              "vertex 0 0.3333333333 0 endloop endfacet endsolid");
  const auto bytes = load_text("a.stl", stl_of({{{0.1f, 0, 0, 1, 0, 0, 0, 0.3333333333f, 0}}}));
  ASSERT_TRUE(text) << text.error().message();
  ASSERT_TRUE(bytes) << bytes.error().message();
  EXPECT_EQ(text->parts[0].positions, bytes->parts[0].positions);
}

TEST(Stl, mistakes_are_reported) {
  constexpr Facet kNan = {{0, 0, 0, 1, std::numeric_limits<float>::infinity(), 0, 0, 1, 0}};
  std::string huge = stl_of({kLeft});
  huge.replace(80, 4, "\xff\xff\xff\xff");
  std::string lying = stl_of({kLeft});
  lying[80] = 9;
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
      {lying, "a.stl byte 80: truncated: 9 triangles declared: expected 534 bytes, got 134"},
      {huge,
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
    EXPECT_FALSE(load_text("a.stl", whole.substr(0, size))) << size;
  }
}

}  // namespace
}  // namespace voxeld
