// Files that are legal glTF 2.0 in ways that few writers use, and files that need extensions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/scene_gltf/gltf_builder.h"

namespace voxeld {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// All integers as a writer of doubles has them: 3 as 3.0.
Json with_decimal_points(const Json& value) {
  if (value.is_number_integer()) return value.get<double>();
  Json out = value;
  if (value.is_structured()) {
    for (auto& element : out) element = with_decimal_points(element);
  }
  return out;
}

// A primitive of the only mesh, drawn behind the first one.
Json& second_primitive(GltfBuilder& builder) {
  Json& primitives = builder.json["meshes"][0]["primitives"];
  primitives.push_back(Json{{"attributes", primitives[0]["attributes"]}});
  return primitives.back();
}

int add_zeros(GltfBuilder& builder, int component_type, const char* type, int64_t count) {
  builder.json["accessors"].push_back(
      Json{{"componentType", component_type}, {"count", count}, {"type", type}});
  return static_cast<int>(builder.json["accessors"].size()) - 1;
}

TEST(LegalGltf, accessors_without_a_buffer_view_are_zeros) {
  GltfBuilder builder = square();
  const int indices = add_zeros(builder, 5123, "SCALAR", 3);
  second_primitive(builder)["indices"] = indices;
  builder.attributes()["NORMAL"] = add_zeros(builder, 5126, "VEC3", 4);
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(scene->triangle_count(), 3U);
  EXPECT_EQ(scene->parts.at(1).positions.at(0), glm::dvec3(0, 0, 0));
  EXPECT_EQ(scene->parts.at(0).positions, square().load()->parts.at(0).positions);
}

TEST(LegalGltf, sparse_elements_lie_over_zeros) {
  GltfBuilder builder = square();
  const int indices = add_zeros(builder, 5123, "SCALAR", 3);
  const int places = builder.add_view({1, 2});
  const int values = builder.add_view({1, 0, 2, 0});
  builder.json["accessors"].back()["sparse"] =
      Json{{"count", 2},
           {"indices", {{"bufferView", places}, {"componentType", 5121}}},
           {"values", {{"bufferView", values}}}};
  builder.primitive()["indices"] = indices;
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_THAT(scene->parts.at(0).indices, ElementsAre(0, 1, 2));
  EXPECT_EQ(scene->parts.at(0).positions.at(2), glm::dvec3(0, 1, 0));
}

TEST(LegalGltf, zeros_that_no_byte_stands_for_are_bounded) {
  GltfBuilder builder = square();
  builder.primitive()["indices"] = add_zeros(builder, 5123, "SCALAR", 500'000'001);
  EXPECT_EQ(outcome(builder.load()),
            "malformed-mesh: a.gltf accessors[2].count: elements of indices without a bufferView: "
            "expected at most 16777216, got 500000001");
}

TEST(LegalGltf, integers_may_have_a_decimal_point) {
  GltfBuilder builder = square();
  builder.attributes()["TEXCOORD_1"] = builder.add_floats({0, 0, 1, 0, 0, 1, 1, 1}, "VEC2");
  builder.primitive()["material"] = 0;
  builder.json["materials"] = Json::parse(
      R"([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}}}])");
  builder.json["textures"] = Json::parse(R"([{"source": 0, "sampler": 0}])");
  builder.json["samplers"] = Json::parse(R"([{"wrapS": 33071}])");
  builder.json["images"] = Json::parse(R"([{"uri": "gone.png"}])");
  const auto as_integers = builder.load();
  const Json all = with_decimal_points(Json::parse(builder.text()));
  ASSERT_THAT(all.dump(), HasSubstr(R"("componentType":5126.0)"));
  const auto scene = load_text(all.dump());
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(scene->parts.at(0).positions, as_integers->parts.at(0).positions);
  EXPECT_EQ(scene->parts.at(0).indices, as_integers->parts.at(0).indices);
  EXPECT_EQ(scene->parts.at(0).uvs, as_integers->parts.at(0).uvs);
  EXPECT_EQ(scene->materials.at(0).wrap_u, Wrap::kClamp);
}

TEST(LegalGltf, fractions_are_no_integers) {
  GltfBuilder builder = square();
  builder.json["accessors"][0]["count"] = 3.5;
  EXPECT_EQ(outcome(builder.load()),
            "malformed-mesh: a.gltf accessors[0].count: wrong value: expected an integer from 0 "
            "to 2^53, got 3.5");
  builder.json["accessors"][0]["count"] = 1e300;
  EXPECT_THAT(outcome(builder.load()), HasSubstr("expected an integer from 0 to 2^53, got 1e+300"));
}

TEST(LegalGltf, a_buffer_that_nothing_uses_needs_no_data) {
  GltfBuilder builder = square();
  Json all = Json::parse(builder.text());
  all["buffers"].push_back(Json{{"byteLength", 100}});
  all["bufferViews"].push_back(Json{{"buffer", 1}, {"byteLength", 100}});
  EXPECT_EQ(outcome(load_text(all.dump())), "ok");
  all["buffers"][1]["uri"] = "not-in-the-upload.bin";
  EXPECT_EQ(outcome(load_text(all.dump())), "ok");
}

TEST(LegalGltf, blanks_around_a_uri_do_not_count) {
  const GltfBuilder builder = square();
  Json all = Json::parse(builder.text());
  auto& uri = all["buffers"][0]["uri"].get_ref<std::string&>();
  uri = " \t" + uri + " \n";
  EXPECT_EQ(outcome(load_text(all.dump())), "ok");
  FakeBundle bundle;
  bundle.files["mesh data.bin"] = builder.bin;
  uri = " mesh data.bin ";
  EXPECT_EQ(outcome(load_text(all.dump(), &bundle)), "ok");
}

TEST(LegalGltf, a_required_texture_format_costs_colours_and_not_the_mesh) {
  GltfBuilder builder = square();
  builder.primitive()["material"] = 0;
  builder.json["materials"] = Json::parse(
      R"([{"name": "skin", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}])");
  builder.json["images"] = Json::parse(R"([{"uri": "skin.ktx2", "mimeType": "image/ktx2"}])");
  builder.json["textures"] =
      Json::parse(R"([{"extensions": {"KHR_texture_basisu": {"source": 0}}}])");
  builder.json["extensionsUsed"] = builder.json["extensionsRequired"] =
      Json::array({"KHR_texture_basisu"});
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(scene->triangle_count(), 2U);
  EXPECT_THAT(warnings(*scene),
              ElementsAre("ignored-extension: a.gltf: the glTF extension \"KHR_texture_basisu\" is "
                          "not read; its textures are left out",
                          "missing-texture: textures[0], named by skin: has no image in a format "
                          "that voxeld reads, only in that of \"KHR_texture_basisu\""));
}

TEST(LegalGltf, an_extension_is_named_though_the_file_does_not_list_it) {
  GltfBuilder builder = triangle();
  builder.json["nodes"][0]["extensions"]["MPEG_media"] = Json::object();
  builder.json["nodes"][0]["extras"]["extensions"]["not_one"] = 1;
  builder.json["materials"] = Json::array({Json{{"extensions", {{"KHR_materials_unlit", {}}}}}});
  EXPECT_THAT(
      warnings(*builder.load()),
      ElementsAre("ignored-extension: a.gltf: the glTF extension \"MPEG_media\" is not read"));
}

TEST(LegalGltf, a_compressed_copy_beside_the_data_is_passed_over) {
  GltfBuilder builder = square();
  builder.primitive()["extensions"]["KHR_draco_mesh_compression"] =
      Json{{"bufferView", 0}, {"attributes", {{"POSITION", 0}}}};
  builder.json["extensionsUsed"] = Json::array({"KHR_draco_mesh_compression"});
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(scene->triangle_count(), 2U);
  EXPECT_THAT(warnings(*scene), ElementsAre());
}

}  // namespace
}  // namespace voxeld
