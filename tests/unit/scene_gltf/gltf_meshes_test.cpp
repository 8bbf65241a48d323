// Geometry: modes, index types, attributes of every component type, sparse accessors.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/scene_gltf/gltf_builder.h"

namespace voxeld {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

MeshPart only_part(const Result<Scene>& scene) {
  EXPECT_EQ(outcome(scene), "ok");
  if (!scene || scene->parts.size() != 1) return {};
  return scene->parts[0];
}

TEST(GltfMeshes, triangle_without_indices) {
  const auto scene = triangle().load();
  const MeshPart part = only_part(scene);
  EXPECT_THAT(part.indices, ElementsAre(0, 1, 2));
  EXPECT_EQ(part.positions[1], glm::dvec3(1, 0, 0));
  EXPECT_EQ(scene->format, "gltf");
  EXPECT_FALSE(scene->has_colors());
}

TEST(GltfMeshes, glb_is_the_same_as_json) {
  const Bytes glb = square().glb();
  const auto scene = load_gltf("a.glb", glb, FakeBundle(), {});
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(scene->format, "glb");
  EXPECT_EQ(scene->parts[0].positions, only_part(square().load()).positions);
  EXPECT_EQ(scene->parts[0].indices, only_part(square().load()).indices);
}

TEST(GltfMeshes, every_truncation_of_a_glb_is_refused) {
  const Bytes glb = square().glb();
  for (size_t size = 0; size < glb.size(); ++size) {
    const auto scene = load_gltf("a.glb", std::span(glb).first(size), FakeBundle(), {});
    ASSERT_FALSE(scene.ok()) << size;
    EXPECT_THAT(outcome(scene), HasSubstr("malformed-mesh: a.glb"));
  }
}

TEST(GltfMeshes, glb_header_errors_name_the_byte) {
  Bytes glb = square().glb();
  const auto load = [&] { return outcome(load_gltf("a.glb", glb, FakeBundle(), {})); };
  Bytes good = glb;
  glb[4] = 1;
  EXPECT_EQ(load(), "unsupported-feature: a.glb: version of the GLB container: expected 2, got 1");
  glb = good;
  glb[16] = 'X';
  EXPECT_EQ(load(),
            "malformed-mesh: a.glb byte 16: type of the first GLB chunk: expected JSON, got "
            "\"XSON\"");
  glb = good;
  glb[15] = 0x7f;
  EXPECT_THAT(load(), HasSubstr("malformed-mesh: a.glb byte 12: a GLB chunk is longer than"));
  glb = good;
  glb.push_back(0);  // after the length that the header states
  EXPECT_EQ(load(), "ok");
}

TEST(GltfMeshes, strips_and_fans_keep_the_orientation) {
  GltfBuilder builder = square();
  builder.primitive()["indices"] = builder.add_u16({0, 1, 2, 3});
  builder.primitive()["mode"] = 5;
  EXPECT_THAT(only_part(builder.load()).indices, ElementsAre(0, 1, 2, 1, 3, 2));
  builder.primitive()["indices"] = builder.add_u16({0, 1, 3, 2});
  builder.primitive()["mode"] = 6;
  const MeshPart fan = only_part(builder.load());
  // Numbers are given in the order of first use: corners 1, 3, 0, 2.
  EXPECT_THAT(fan.indices, ElementsAre(0, 1, 2, 1, 3, 2));
  EXPECT_EQ(fan.positions[0], glm::dvec3(1, 0, 0));
}

TEST(GltfMeshes, bridges_of_strips_are_left_out) {
  GltfBuilder builder = square();
  builder.primitive()["indices"] = builder.add_u16({0, 1, 2, 2, 3, 3});
  builder.primitive()["mode"] = 5;
  EXPECT_EQ(only_part(builder.load()).indices.size(), 3u);
}

TEST(GltfMeshes, indices_of_8_and_32_bits) {
  GltfBuilder builder = square();
  builder.primitive()["indices"] = builder.add_accessor({3, 2, 1}, 5121, "SCALAR", 3);
  EXPECT_THAT(only_part(builder.load()).indices, ElementsAre(0, 1, 2));
  builder.primitive()["indices"] =
      builder.add_accessor({3, 0, 0, 0, 2, 0, 0, 0, 1, 0, 0, 0}, 5125, "SCALAR", 3);
  EXPECT_EQ(only_part(builder.load()).positions[0], glm::dvec3(1, 1, 0));
}

TEST(GltfMeshes, points_and_lines_are_skipped_with_a_warning) {
  GltfBuilder builder = square();
  Json lines = builder.primitive();
  lines["mode"] = 3;
  builder.json["meshes"][0]["primitives"].push_back(lines);
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_THAT(warnings(*scene), ElementsAre("skipped-primitive: a.gltf: 1 primitives of points or "
                                            "lines were left out"));
}

TEST(GltfMeshes, primitives_without_positions_are_skipped_with_a_warning) {
  GltfBuilder builder = square();
  Json& primitives = builder.json["meshes"][0]["primitives"];
  primitives.push_back(Json{{"attributes", {{"_DATA", 0}}}, {"indices", 1}});
  primitives.push_back(Json{{"attributes", Json::object()}, {"mode", 5}});
  primitives.push_back(Json{{"attributes", {{"_DATA", 0}}}, {"mode", 0}});
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(scene->triangle_count(), 2u);
  EXPECT_THAT(
      warnings(*scene),
      ElementsAre("skipped-primitive: a.gltf: 1 primitives of points or lines, 2 primitives "
                  "without POSITION were left out"));
}

TEST(GltfMeshes, corners_that_are_no_whole_triangle_are_left_out_with_a_warning) {
  GltfBuilder builder = square();
  builder.primitive()["indices"] = builder.add_u16({0, 1, 2, 2, 3});
  Json strip = builder.primitive();
  strip["mode"] = 5;
  strip["indices"] = builder.add_u16({0, 1});
  builder.json["meshes"][0]["primitives"].push_back(strip);
  const auto scene = builder.load();
  EXPECT_THAT(only_part(scene).indices, ElementsAre(0, 1, 2));
  EXPECT_THAT(
      warnings(*scene),
      ElementsAre("incomplete-triangle: a.gltf: the last corners of 2 primitives (first: "
                  "meshes[0].primitives[0], 5 corners) are no triangle; they were left out"));
  // Without indices, vertices are corners.
  GltfBuilder plain = triangle();
  plain.attributes()["POSITION"] = plain.add_floats({0, 0, 0, 1, 0, 0, 0, 1, 0, 5, 5, 5}, "VEC3");
  EXPECT_THAT(only_part(plain.load()).indices, ElementsAre(0, 1, 2));
}

TEST(GltfMeshes, unused_vertices_are_dropped) {
  std::vector<float> corners(3 * 10'000, 0.5f);
  corners[3 * 9'000] = 7;
  GltfBuilder builder;
  builder.attributes()["POSITION"] = builder.add_floats(corners, "VEC3");
  builder.primitive()["indices"] = builder.add_u16({9000, 1, 9001, 9001, 1, 9000});
  const MeshPart part = only_part(builder.load());
  EXPECT_EQ(part.positions.size(), 3u);
  EXPECT_EQ(part.positions[0].x, 7);
  EXPECT_THAT(part.indices, ElementsAre(0, 1, 2, 2, 1, 0));
}

TEST(GltfMeshes, quantized_positions_are_scaled_only_where_normalized) {
  GltfBuilder builder;
  const Bytes corners = {0, 0, 0, 0, 127, 0, 0, 0, 0, 129, 0, 0};  // i8, stride 4
  builder.attributes()["POSITION"] = builder.add_accessor(corners, 5120, "VEC3", 3);
  builder.json["bufferViews"][0]["byteStride"] = 4;
  EXPECT_EQ(only_part(builder.load()).positions[1], glm::dvec3(127, 0, 0));
  EXPECT_EQ(only_part(builder.load()).positions[2], glm::dvec3(0, -127, 0));
  builder.json["accessors"][0]["normalized"] = true;
  EXPECT_EQ(only_part(builder.load()).positions[1], glm::dvec3(1, 0, 0));
  EXPECT_EQ(only_part(builder.load()).positions[2], glm::dvec3(0, -1, 0));
}

TEST(GltfMeshes, colours_of_all_types_are_linear) {
  GltfBuilder builder = triangle();
  builder.attributes()["COLOR_0"] = builder.add_floats({1, 0, 0, 0, 0.5f, 0, 2, -1, NAN}, "VEC3");
  auto scene = builder.load();
  EXPECT_EQ(only_part(scene).colors[1], glm::vec4(0, 0.5f, 0, 1));
  EXPECT_EQ(only_part(scene).colors[2], glm::vec4(1, 0, 0, 1));
  EXPECT_TRUE(scene->has_colors());
  builder.attributes()["COLOR_0"] =
      builder.add_accessor({255, 51, 0, 255, 0, 0, 0, 0, 0, 0, 0, 0}, 5121, "VEC4", 3);
  EXPECT_EQ(only_part(builder.load()).colors[0], glm::vec4(1, 0.2f, 0, 1));
  builder.primitive()["material"] = 0;
  builder.json["materials"] = Json::parse(R"([{"alphaMode": "BLEND"}])");
  builder.attributes()["COLOR_0"] =
      builder.add_u16({65535, 0, 0, 32768, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC4");
  EXPECT_NEAR(only_part(builder.load()).colors[0].w, 0.5, 1e-4);
}

TEST(GltfMeshes, strides_need_not_be_multiples_of_4) {
  GltfBuilder builder = triangle();
  const int colors = builder.add_accessor({255, 0, 0, 0, 255, 0, 0, 0, 255}, 5121, "VEC3", 3);
  builder.attributes()["COLOR_0"] = colors;
  builder.json["bufferViews"].back()["byteStride"] = 3;
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(only_part(scene).colors[2], glm::vec4(0, 0, 1, 1));
}

TEST(GltfMeshes, sparse_accessors_replace_elements) {
  GltfBuilder builder = square();
  const int index_view = builder.add_view({3, 0});
  GltfBuilder value;
  value.add_floats({5, 6, 7}, "VEC3");
  const int value_view = builder.add_view(value.bin);
  builder.json["accessors"][0]["sparse"] =
      Json{{"count", 1},
           {"indices", {{"bufferView", index_view}, {"componentType", 5123}}},
           {"values", {{"bufferView", value_view}}}};
  const MeshPart part = only_part(builder.load());
  EXPECT_EQ(part.positions[3], glm::dvec3(5, 6, 7));
  EXPECT_EQ(part.positions[1], glm::dvec3(1, 0, 0));
  builder.json["accessors"][0].erase("bufferView");  // then the others are zero
  const MeshPart zeros = only_part(builder.load());
  EXPECT_EQ(zeros.positions[3], glm::dvec3(5, 6, 7));
  EXPECT_EQ(zeros.positions[1], glm::dvec3(0, 0, 0));
}

TEST(GltfMeshes, morph_targets_take_their_default_weights) {
  GltfBuilder builder = triangle();
  const int target = builder.add_floats({0, 0, 2, 0, 0, 0, 0, 0, 0}, "VEC3");
  builder.primitive()["targets"] = Json::array({Json{{"POSITION", target}}});
  EXPECT_EQ(only_part(builder.load()).positions[0], glm::dvec3(0, 0, 0));
  builder.json["meshes"][0]["weights"] = {0.5};
  EXPECT_EQ(only_part(builder.load()).positions[0], glm::dvec3(0, 0, 1));
  builder.json["nodes"][0]["weights"] = {1.0};  // of the node, before those of the mesh
  EXPECT_EQ(only_part(builder.load()).positions[0], glm::dvec3(0, 0, 2));
}

TEST(GltfMeshes, normals_without_direction_are_repaired) {
  GltfBuilder builder = triangle();
  builder.attributes()["NORMAL"] = builder.add_floats({0, 0, 0, 0, 3, 0, NAN, 0, 0}, "VEC3");
  const MeshPart part = only_part(builder.load());
  EXPECT_THAT(part.normals,
              ElementsAre(glm::vec3(0, 0, 1), glm::vec3(0, 1, 0), glm::vec3(0, 0, 1)));
}

}  // namespace
}  // namespace voxeld
