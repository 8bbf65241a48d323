// KHR_materials_variants: the material of each primitive in the variant that a request names.
#include <gtest/gtest.h>

#include "server/scene/load.h"
#include "tests/unit/scene_gltf/gltf_builder.h"

namespace voxeld {
namespace {

// A triangle, white by itself, red in "beach" and blue in "street" and "night".
GltfBuilder with_variants() {
  GltfBuilder builder = triangle();
  builder.primitive()["material"] = 0;
  builder.json["materials"] = Json::parse(R"([
    {"name": "white", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1]}},
    {"name": "red", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}},
    {"name": "blue", "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 1, 1]}}])");
  builder.json["extensions"]["KHR_materials_variants"]["variants"] = Json::parse(
      R"([{"name": "beach"}, {"name": "street"}, {"name": "night"}, {"name": "bare"}])");
  builder.primitive()["extensions"]["KHR_materials_variants"]["mappings"] =
      Json::parse(R"([{"material": 1, "variants": [0]}, {"material": 2, "variants": [1, 2]}])");
  return builder;
}

std::string material_in(GltfBuilder builder, const std::string& variant) {
  LoadOptions options;
  if (!variant.empty()) options.variant = variant;
  const auto scene = builder.load(nullptr, options);
  if (!scene) return scene.error().message();
  return scene->materials.at(static_cast<size_t>(scene->parts.at(0).material)).name;
}

TEST(GltfVariants, a_variant_is_chosen_by_name_or_number) {
  EXPECT_EQ(material_in(with_variants(), ""), "white");
  EXPECT_EQ(material_in(with_variants(), "beach"), "red");
  EXPECT_EQ(material_in(with_variants(), "night"), "blue");
  EXPECT_EQ(material_in(with_variants(), "1"), "blue");
  EXPECT_EQ(material_in(with_variants(), "bare"), "white") << "no mapping names it";
  GltfBuilder numbered = with_variants();
  numbered.json["extensions"]["KHR_materials_variants"]["variants"][2]["name"] = "0";
  EXPECT_EQ(material_in(numbered, "0"), "blue") << "names come before numbers";
}

TEST(GltfVariants, unknown_variants_are_refused_with_those_that_there_are) {
  const std::string known =
      "variant: there is none of this name or number: expected \"beach\", \"street\", \"night\", "
      "\"bare\", or 0 to 3, got ";
  EXPECT_EQ(material_in(with_variants(), "moon"), known + "\"moon\"");
  EXPECT_EQ(material_in(with_variants(), "4"), known + "\"4\"");
  EXPECT_EQ(material_in(with_variants(), "-1"), known + "\"-1\"");
  EXPECT_EQ(material_in(triangle(), "beach"),
            "variant: the file has no variants of materials: got \"beach\"");
}

TEST(GltfVariants, broken_mappings_are_refused_by_their_place) {
  GltfBuilder builder = with_variants();
  Json& mappings = builder.primitive()["extensions"]["KHR_materials_variants"]["mappings"];
  mappings[1]["variants"][0] = 7;
  EXPECT_EQ(material_in(builder, "beach"),
            "a.gltf meshes[0].primitives[0] variants: wrong value: expected 0 to 3, got 7");
  mappings[1] = Json::parse(R"({"variants": [0]})");
  EXPECT_EQ(material_in(builder, ""),
            "a.gltf meshes[0].primitives[0].extensions.KHR_materials_variants.mappings[1]"
            ".material: is missing: expected an index, got nothing");
}

TEST(GltfVariants, other_formats_have_none) {
  const std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  const std::vector<uint8_t> bytes(text.begin(), text.end());
  for (const auto& [is_moving, expected] : {std::pair(false, "obj"), std::pair(true, "obj")}) {
    const LoadOptions options{.variant = "beach"};
    const std::string message = is_moving
                                    ? load_animated_scene("a.obj", bytes, options).error().message()
                                    : load_scene("a.obj", bytes, options).error().message();
    EXPECT_EQ(message,
              "variant: the file has no variants of materials: expected gltf or glb, got obj")
        << expected;
  }
}

}  // namespace
}  // namespace voxeld
