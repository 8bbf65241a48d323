// Colours: factors, textures from every place, texture transforms, what is ignored.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <tuple>

#include "server/scene/gltf/container.h"
#include "tests/unit/scene_gltf/gltf_builder.h"

namespace voxeld {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// A triangle with a texture whose image is `image`.
GltfBuilder textured(const Json& image) {
  GltfBuilder builder = triangle();
  builder.attributes()["TEXCOORD_0"] = builder.add_floats({0, 0, 1, 0, 0, 1}, "VEC2");
  builder.primitive()["material"] = 0;
  builder.json["materials"] = Json::parse(
      R"([{"name": "skin", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}])");
  builder.json["textures"] = Json::parse(R"([{"source": 0, "sampler": 0}])");
  builder.json["samplers"] = Json::parse(R"([{"wrapS": 33071, "wrapT": 33648}])");
  builder.json["images"] = Json::array({image});
  return builder;
}

Json& texture_info(GltfBuilder& builder) {
  return builder.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"];
}

TEST(GltfMaterials, base_colour_is_linear_and_counts_as_colour) {
  GltfBuilder builder = triangle();
  builder.primitive()["material"] = 0;
  builder.json["materials"] =
      Json::parse(R"([{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 2, 1]}}])");
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(scene->materials.at(0).base_color, glm::vec4(0.5f, 0.25f, 1, 1));
  EXPECT_TRUE(scene->has_colors());
}

TEST(GltfMaterials, a_material_that_says_no_colour_gives_none) {
  GltfBuilder builder = triangle();
  builder.primitive()["material"] = 0;
  builder.json["materials"] = Json::parse(R"([{"name": "grey", "doubleSided": true}])");
  EXPECT_FALSE(builder.load()->has_colors());
}

TEST(GltfMaterials, specular_glossiness_is_read_by_its_diffuse_part) {
  GltfBuilder builder = textured({{"uri", "gone.png"}});
  builder.json["materials"] = Json::parse(R"([{"extensions":
    {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0, 1, 0, 1],
     "diffuseTexture": {"index": 0}}}}])");
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(scene->materials.at(0).base_color, glm::vec4(0, 1, 0, 1));
  EXPECT_EQ(scene->missing_files.at(0).name, "gone.png");
}

TEST(GltfMaterials, metals_of_specular_glossiness_have_the_colour_of_their_specular_factor) {
  const struct {
    const char* workflow;
    glm::vec3 color;
  } cases[] = {
      {R"({"diffuseFactor": [0, 0, 0, 1], "specularFactor": [1, 0.5, 0.25]})", {1, 0.5f, 0.25f}},
      {R"({"diffuseFactor": [0, 0, 0, 1], "specularFactor": [0.52, 0, 0]})", {0.26f, 0, 0}},
      {R"({"diffuseFactor": [0, 1, 0, 1], "specularFactor": [0.04, 0.04, 0.04]})", {0, 1, 0}},
      {R"({"diffuseFactor": [0, 1, 0, 1]})", {0, 1, 0}},
      {R"({"diffuseFactor": [0, 0, 0, 1], "specularFactor": [1, 1, 1],
           "specularGlossinessTexture": {"index": 0}})",
       {0, 0, 0}},
      {R"({"diffuseFactor": [0, 0, 0, 1], "specularFactor": [1, 1, 1],
           "diffuseTexture": {"index": 0}})",
       {0, 0, 0}}};
  for (const auto& [workflow, color] : cases) {
    GltfBuilder builder = textured({{"uri", "gone.png"}});
    Json material;
    material["extensions"]["KHR_materials_pbrSpecularGlossiness"] = Json::parse(workflow);
    builder.json["materials"] = Json::array({material});
    const auto scene = builder.load();
    ASSERT_EQ(outcome(scene), "ok") << workflow;
    const glm::vec4 got = scene->materials.at(0).base_color;
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(got[i], color[i], 1e-6f) << workflow;
    EXPECT_EQ(got.a, 1.0f) << workflow;
  }
}

TEST(GltfMaterials, a_base_colour_counts_before_specular_glossiness) {
  const struct {
    const char* base;
    const char* workflow;
    glm::vec4 color;
    size_t textures;
  } cases[] = {{R"({"baseColorFactor": [1, 0.5, 0, 1]})",
                R"({"diffuseFactor": [0, 0, 0, 1]})",
                {1, 0.5f, 0, 1},
                0},
               {R"({"baseColorTexture": {"index": 0}})",
                R"({"diffuseFactor": [0, 0, 0, 1]})",
                {1, 1, 1, 1},
                1},
               // What exporters write beside the extension is not always the same material.
               {R"({"baseColorFactor": [1, 1, 1, 1]})",
                R"({"diffuseFactor": [0, 1, 0, 1]})",
                {0, 1, 0, 1},
                0},
               {R"({"metallicFactor": 0})", R"({"diffuseFactor": [0, 1, 0, 1]})", {0, 1, 0, 1}, 0},
               {R"({"baseColorFactor": [0.5, 0.5, 0.5, 1]})",
                R"({"diffuseTexture": {"index": 0}})",
                {1, 1, 1, 1},
                1}};
  for (const auto& [base, workflow, color, textures] : cases) {
    GltfBuilder builder = textured({{"uri", "gone.png"}});
    Json material;
    material["pbrMetallicRoughness"] = Json::parse(base);
    material["extensions"]["KHR_materials_pbrSpecularGlossiness"] = Json::parse(workflow);
    builder.json["materials"] = Json::array({material});
    const auto scene = builder.load();
    ASSERT_EQ(outcome(scene), "ok") << base;
    EXPECT_EQ(scene->materials.at(0).base_color, color) << base;
    EXPECT_EQ(scene->missing_files.size(), textures) << base;
  }
}

TEST(GltfMaterials, a_missing_texture_is_a_warning_that_names_it) {
  const auto scene = textured({{"uri", "textures/gone.png"}}).load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_THAT(
      warnings(*scene),
      ElementsAre("missing-texture: textures/gone.png, named by skin: is not in the upload"));
  ASSERT_EQ(scene->missing_files.size(), 1u);
  EXPECT_EQ(scene->missing_files[0].name, "textures/gone.png");
  EXPECT_EQ(scene->missing_files[0].needed_by, "skin");
  EXPECT_EQ(scene->materials.at(0).image, -1);
  EXPECT_FALSE(scene->has_colors());
}

TEST(GltfMaterials, a_broken_texture_is_a_warning_that_names_it) {
  FakeBundle bundle;
  bundle.files["a.png"] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n', 0, 0};
  const auto scene = textured({{"uri", "a.png"}}).load(&bundle);
  ASSERT_EQ(outcome(scene), "ok");
  ASSERT_EQ(scene->warnings.size(), 1u);
  EXPECT_EQ(scene->warnings[0].code, "broken-texture");
  EXPECT_THAT(scene->warnings[0].detail, HasSubstr("a.png, named by skin"));
  EXPECT_EQ(scene->missing_files.at(0).name, "a.png");
}

TEST(GltfMaterials, a_view_outside_of_its_buffer_is_a_broken_texture) {
  GltfBuilder builder = textured({{"bufferView", 0}, {"mimeType", "image/png"}});
  builder.json["bufferViews"].push_back(
      Json{{"buffer", 0}, {"byteOffset", 40}, {"byteLength", 1'000'000'000}});
  builder.json["images"][0]["bufferView"] = 2;
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(scene->warnings.at(0).code, "broken-texture");
  EXPECT_THAT(scene->warnings.at(0).detail, HasSubstr("bufferViews[2]"));
}

TEST(GltfMaterials, images_come_from_files_views_and_data_uris) {
  const Bytes tga = one_pixel_tga(10, 20, 30);
  FakeBundle bundle;
  bundle.files["my image.tga"] = tga;
  GltfBuilder view = textured({{"mimeType", "image/x"}});
  view.json["images"][0]["bufferView"] = view.add_view(tga);
  view.json["bufferViews"].back()["byteLength"] = tga.size();
  std::string uri = "data:image/x-tga,";
  for (const uint8_t byte : tga) {
    char escaped[4];
    std::snprintf(escaped, sizeof escaped, "%%%02x", byte);
    uri += escaped;
  }
  for (const GltfBuilder& builder :
       {textured({{"uri", "my image.tga"}}), view, textured({{"uri", uri}})}) {
    const auto scene = builder.load(&bundle);
    ASSERT_EQ(outcome(scene), "ok");
    EXPECT_THAT(warnings(*scene), ElementsAre());
    ASSERT_EQ(scene->images.size(), 1u);
    EXPECT_THAT(scene->images[0].rgba, ElementsAre(10, 20, 30, 255));
    EXPECT_EQ(scene->materials[0].image, 0);
    EXPECT_EQ(scene->materials[0].wrap_u, Wrap::kClamp);
    EXPECT_EQ(scene->materials[0].wrap_v, Wrap::kMirror);
    EXPECT_TRUE(scene->has_colors());
  }
}

TEST(GltfMaterials, alpha_is_ignored_cut_off_or_kept) {
  FakeBundle bundle;
  bundle.files["a.tga"] = {0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 32, 8, 30, 20, 10, 64};
  for (const char* mode : {"", "OPAQUE", "MASK", "BLEND"}) {
    SCOPED_TRACE(mode);
    GltfBuilder builder = textured({{"uri", "a.tga"}});
    builder.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = {1, 1, 1, 0.5f};
    if (*mode != 0) builder.json["materials"][0]["alphaMode"] = mode;
    builder.attributes()["COLOR_0"] =
        builder.add_floats({1, 1, 1, 0, 1, 1, 1, 0, 1, 1, 1, 0}, "VEC4");
    const bool is_blended = *mode == 'B', is_masked = *mode == 'M';
    const auto scene = builder.load(&bundle);
    ASSERT_EQ(outcome(scene), "ok");
    EXPECT_EQ(scene->materials.at(0).base_color.a, is_blended ? 0.5f : 1.0f);
    EXPECT_EQ(scene->parts.at(0).colors.at(0).a, is_blended || is_masked ? 0.0f : 1.0f);
    const int alpha = is_blended ? 64 : is_masked ? 0 : 255;
    EXPECT_THAT(scene->images.at(0).rgba, ElementsAre(10, 20, 30, alpha));
  }
}

TEST(GltfMaterials, the_cutoff_is_compared_with_texel_times_base_colour) {
  FakeBundle bundle;  // alpha 64 of 255
  bundle.files["a.tga"] = {0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 32, 8, 30, 20, 10, 64};
  for (const auto& [cutoff, base, alpha] : {std::tuple{0.25, 1.0, 255},
                                            {0.26, 1.0, 0},
                                            {0.25, 0.5, 0},
                                            {0.125, 0.5, 255},
                                            {0.0, 0.0, 255},
                                            {1.5, 1.0, 0}}) {
    GltfBuilder builder = textured({{"uri", "a.tga"}});
    Json& material = builder.json["materials"][0];
    material["alphaMode"] = "MASK";
    material["alphaCutoff"] = cutoff;
    material["pbrMetallicRoughness"]["baseColorFactor"] = {1, 1, 1, base};
    const auto scene = builder.load(&bundle);
    ASSERT_EQ(outcome(scene), "ok");
    EXPECT_THAT(scene->images.at(0).rgba, ElementsAre(10, 20, 30, alpha)) << cutoff << ' ' << base;
    EXPECT_EQ(scene->materials.at(0).base_color.a, 1.0f);
    builder.json["materials"][0]["pbrMetallicRoughness"].erase("baseColorTexture");
    const auto plain = builder.load(&bundle);
    ASSERT_EQ(outcome(plain), "ok");
    EXPECT_EQ(plain->materials.at(0).base_color.a, base >= cutoff ? 1.0f : 0.0f);
  }
}

TEST(GltfMaterials, an_image_may_be_used_with_and_without_its_alpha) {
  FakeBundle bundle;
  bundle.files["a.tga"] = {0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 32, 8, 30, 20, 10, 64};
  GltfBuilder builder = textured({{"uri", "a.tga"}});
  Json glass = builder.json["materials"][0];
  glass["alphaMode"] = "BLEND";
  builder.json["materials"].push_back(glass);
  builder.json["materials"].push_back(glass);
  for (const int material : {1, 2}) {
    Json primitive = builder.primitive();
    primitive["material"] = material;
    builder.json["meshes"][0]["primitives"].push_back(primitive);
  }
  const auto scene = builder.load(&bundle);
  ASSERT_EQ(outcome(scene), "ok");
  ASSERT_EQ(scene->images.size(), 2u);
  EXPECT_EQ(scene->images[static_cast<size_t>(scene->materials.at(0).image)].rgba[3], 255);
  EXPECT_EQ(scene->images[static_cast<size_t>(scene->materials.at(1).image)].rgba[3], 64);
  EXPECT_EQ(scene->materials.at(2).image, scene->materials.at(1).image);
}

TEST(GltfMaterials, inspection_names_images_without_decoding) {
  FakeBundle bundle;
  bundle.files["a.png"] = {1, 2, 3};
  const auto scene = textured({{"uri", "a.png"}}).load(&bundle, {.decode_images = false});
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(scene->images.at(0).name, "a.png");
  EXPECT_TRUE(scene->images.at(0).rgba.empty());
}

TEST(GltfMaterials, webp_takes_the_place_of_the_fallback) {
  GltfBuilder builder = textured({{"uri", "fallback.png"}});
  builder.json["images"].push_back(Json{{"uri", "small.webp"}});
  builder.json["textures"][0]["extensions"]["EXT_texture_webp"]["source"] = 1;
  builder.json["extensionsRequired"] = Json::array({"EXT_texture_webp"});
  EXPECT_EQ(builder.load()->missing_files.at(0).name, "small.webp");
}

TEST(GltfMaterials, a_texture_in_another_format_only_is_missing) {
  GltfBuilder builder = textured({{"uri", "a.ktx2"}});
  builder.json["textures"] = Json::array({Json::object()});
  EXPECT_THAT(warnings(*builder.load()),
              ElementsAre("missing-texture: textures[0], named by skin: has no image in a format "
                          "that voxeld reads"));
}

TEST(GltfMaterials, texture_coordinates_have_their_origin_at_the_top_left) {
  const auto scene = textured({{"uri", "a.png"}}).load();
  EXPECT_THAT(scene->parts.at(0).uvs,
              ElementsAre(glm::vec2(0, 0), glm::vec2(1, 0), glm::vec2(0, 1)));
}

TEST(GltfMaterials, the_texture_names_its_set_of_coordinates) {
  GltfBuilder builder = textured({{"uri", "a.png"}});
  builder.attributes()["TEXCOORD_3"] = builder.add_u16({0, 0, 65535, 0, 0, 65535}, "VEC2");
  builder.json["accessors"].back()["normalized"] = true;
  texture_info(builder)["texCoord"] = 3;
  EXPECT_EQ(builder.load()->parts.at(0).uvs.at(1), glm::vec2(1, 0));
  texture_info(builder)["extensions"]["KHR_texture_transform"] =
      Json{{"texCoord", 0}, {"offset", {7, 0}}};
  EXPECT_EQ(builder.load()->parts.at(0).uvs.at(1), glm::vec2(8, 0));
}

// The example of the extension's text: the lower left quarter, turned clockwise by 90 degrees.
TEST(GltfMaterials, texture_transforms_are_baked) {
  GltfBuilder builder = textured({{"uri", "a.png"}});
  texture_info(builder)["extensions"]["KHR_texture_transform"] =
      Json{{"offset", {0, 1}}, {"rotation", 1.57079632679}, {"scale", {0.5, 0.5}}};
  builder.json["extensionsRequired"] = Json::array({"KHR_texture_transform"});
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  const auto& uvs = scene->parts[0].uvs;
  const float expected[3][2] = {{0, 1}, {0, 0.5f}, {0.5f, 1}};
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(uvs[i].x, expected[i][0], 1e-6);
    EXPECT_NEAR(uvs[i].y, expected[i][1], 1e-6);
  }
}

TEST(GltfMaterials, optional_extensions_that_are_not_read_are_warnings) {
  GltfBuilder builder = triangle();
  builder.json["extensionsUsed"] = {"KHR_materials_unlit", "KHR_lights_punctual", "MY_extension"};
  EXPECT_THAT(warnings(*builder.load()),
              ElementsAre("ignored-extension: a.gltf: the glTF extension \"MY_extension\" is not "
                          "read"));
}

TEST(GltfBuffers, data_uris_in_all_their_forms) {
  const auto text = [](std::string_view uri) {
    const auto bytes = gltf::decode_data_uri(uri);
    return bytes ? std::string(bytes->begin(), bytes->end()) : "none";
  };
  EXPECT_EQ(text("data:application/octet-stream;base64,aGVsbG8="), "hello");
  EXPECT_EQ(text("data:;base64,aGVsbG8"), "hello");
  EXPECT_EQ(text("data:;base64,aGVsbG8%3D"), "hello");
  EXPECT_EQ(text("data:;base64,-_-_"), text("data:;base64,+/+/"));
  EXPECT_EQ(text("data:text/plain,a%20b"), "a b");
  EXPECT_EQ(text("data:;base64,"), "");
  EXPECT_EQ(text("data:;base64,a"), "none");
  EXPECT_EQ(text("data:;base64,aG Vs"), "none");
  EXPECT_EQ(text("data:;base64"), "none");
  EXPECT_EQ(text("file.bin"), "none");
}

TEST(GltfBuffers, a_file_may_be_longer_than_the_buffer) {
  FakeBundle bundle;
  GltfBuilder builder = triangle();
  bundle.files["a b.bin"] = builder.bin;
  bundle.files["a b.bin"].resize(100);
  builder.json["buffers"] = Json::array({Json{{"byteLength", 36}, {"uri", "a b.bin"}}});
  EXPECT_EQ(outcome(builder.load(&bundle)), "ok");
}

}  // namespace
}  // namespace voxeld
