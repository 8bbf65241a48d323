#include "server/scene/obj/mtl.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace voxeld {
namespace {

MtlMaterial parse_one(std::string_view statements, Scene* warnings = nullptr) {
  Scene scene;
  const auto all = parse_mtl("a.mtl", "newmtl m\n" + std::string(statements), scene);
  EXPECT_EQ(all.size(), 1u);
  if (warnings != nullptr) *warnings = scene;
  return all.empty() ? MtlMaterial() : all[0];
}

TEST(Mtl, reads_the_forms_that_exporters_write) {
  Scene scene;
  const auto all =
      parse_mtl("a.mtl",
                "# Blender\r\nKd 1 1 1\r\nnewmtl first one\r\nNs 1\r\n Kd 0.5 0.25 1 \r\n"
                "d 0.5\r\nmap_Kd C:\\tex\\my file#1.png\r\nnewmtl b\r\nillum 2\r\n",
                scene);
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].name, "first one");
  EXPECT_EQ(all[0].kd, glm::vec3(0.5f, 0.25f, 1.0f));
  EXPECT_EQ(all[0].dissolve, 0.5);
  EXPECT_EQ(all[0].map_kd, "C:\\tex\\my file#1.png");
  EXPECT_FALSE(all[1].kd);
  EXPECT_THAT(scene.warnings, testing::IsEmpty());
}

TEST(Mtl, options_of_maps_are_read_or_skipped) {
  const MtlMaterial m = parse_one(
      "map_Kd -blendu on -bm 0.5 -mm 0 1 -s 2 3 4 -o 0.5 -t 1 1 1 -texres 8 -clamp on -imfchan r "
      "-cc off a b.png\n");
  EXPECT_EQ(m.map_kd, "a b.png");
  EXPECT_EQ(m.map_options(), (MapOptions{{2, 3}, {0.5f, 0.0f}, true}));
}

TEST(Mtl, maps_of_opacity_name_a_file_and_a_channel) {
  const MtlMaterial plain = parse_one("map_d holes.png\nmap_Kd -imfchan r a.png\n");
  EXPECT_EQ(plain.map_d, "holes.png");
  EXPECT_EQ(plain.map_d_channel, 0);
  EXPECT_EQ(plain.map_kd, "a.png");
  const MtlMaterial matte = parse_one("MAP_D -s 2 2 2 -imfchan m my holes.png\n");
  EXPECT_EQ(matte.map_d, "my holes.png");
  EXPECT_EQ(matte.map_d_channel, 'm');
  EXPECT_EQ(matte.map_options().scale, glm::vec2(2.0f));
  const MtlMaterial both = parse_one("map_Kd -s 3 3 a.png\nmap_d -s 2 2 holes.png\n");
  EXPECT_EQ(both.map_options().scale, glm::vec2(3.0f));
}

TEST(Mtl, options_of_colour_spaces_are_read_and_those_that_change_colours_are_reported) {
  Scene scene;
  EXPECT_EQ(parse_one("map_Kd -colorspace sRGB -s nan 2 a.png\n", &scene).map_kd, "a.png");
  EXPECT_THAT(scene.warnings, testing::IsEmpty());
  EXPECT_EQ(parse_one("map_Kd -colorspace linear a.png\nmap_Kd -mm 0 2 b.png\n", &scene).map_kd,
            "b.png");
  ASSERT_EQ(scene.warnings.size(), 2u);
  EXPECT_EQ(scene.warnings[0].code, "ignored-map-option");
  EXPECT_EQ(scene.warnings[0].detail,
            "a.mtl line 2: map_Kd -colorspace linear: the texture is taken as sRGB");
  EXPECT_EQ(scene.warnings[1].detail,
            "a.mtl line 3: map_Kd -mm 0 2: the texture is taken as it is");
  parse_one("map_d -colorspace linear -mm 0.5 1 a.png\n", &scene);
  ASSERT_EQ(scene.warnings.size(), 1u);
  EXPECT_EQ(scene.warnings[0].detail,
            "a.mtl line 2: map_d -mm 0.5 1: the texture is taken as it is");
}

TEST(Mtl, names_that_look_like_options_are_names) {
  EXPECT_EQ(parse_one("map_Kd -my-texture.png").map_kd, "-my-texture.png");
  EXPECT_EQ(parse_one("map_Kd").map_kd, "");
  EXPECT_EQ(parse_one("map_Kd -clamp").map_kd, "");
  EXPECT_EQ(parse_one("map_Kd -s 1").map_kd, "");
}

TEST(Mtl, one_number_of_kd_stands_for_three) {
  EXPECT_EQ(parse_one("Kd 0.5\n").kd, glm::vec3(0.5f));
}

TEST(Mtl, unreadable_values_are_warnings) {
  Scene scene;
  EXPECT_FALSE(parse_one("Kd spectral file.rfl\nd\nTr x\n", &scene).kd);
  ASSERT_EQ(scene.warnings.size(), 3u);
  EXPECT_EQ(scene.warnings[0].code, "bad-material");
  EXPECT_EQ(scene.warnings[0].detail, "a.mtl line 2: Kd: expected numbers, got \"spectral\"");
  EXPECT_EQ(scene.warnings[2].detail, "a.mtl line 4: Tr: expected numbers, got \"x\"");
}

TEST(Mtl, statements_of_more_than_64_kib_are_left_out) {
  Scene scene;
  const std::string path(65'536 - std::string_view("map_Kd ").size(), 'x');
  EXPECT_EQ(parse_one("map_Kd " + path + "\nKd 1 1 1\n", &scene).map_kd, path);
  EXPECT_THAT(scene.warnings, testing::IsEmpty());
  const MtlMaterial m = parse_one("map_Kd x" + path + "\nKd 1 1 1\n", &scene);
  EXPECT_EQ(m.map_kd, "");
  EXPECT_TRUE(m.kd);
  ASSERT_EQ(scene.warnings.size(), 1u);
  EXPECT_EQ(scene.warnings[0].code, "bad-material");
  EXPECT_EQ(scene.warnings[0].detail,
            "a.mtl line 2: too many bytes of a statement: expected at most 65536, got 65537");
}

TEST(Mtl, kd_is_srgb) {
  Scene scene;
  const Material m = material_of(parse_one("Kd 0.5 0 1\n"), scene);
  EXPECT_NEAR(m.base_color.x, 0.21404f, 1e-4f);
  EXPECT_EQ(m.base_color.z, 1.0f);
}

TEST(Mtl, black_under_a_texture_is_taken_as_white) {
  Scene scene;
  EXPECT_EQ(material_of(parse_one("Kd 0 0 0\nmap_Kd a.png\n"), scene).base_color, glm::vec4(1.0f));
  EXPECT_EQ(material_of(parse_one("Kd 0 0 0\n"), scene).base_color, glm::vec4(0, 0, 0, 1));
}

TEST(Mtl, dissolve_wins_over_transparency) {
  Scene scene;
  EXPECT_EQ(material_of(parse_one("d 0.25\nTr 0.9\n"), scene).base_color.w, 0.25f);
  EXPECT_EQ(material_of(parse_one("Tr 0.75\n"), scene).base_color.w, 0.25f);
  EXPECT_EQ(material_of(parse_one("d -halo 0.5\n"), scene).base_color.w, 0.5f);
  EXPECT_EQ(material_of(parse_one(""), scene).base_color.w, 1.0f);
  EXPECT_THAT(scene.warnings, testing::IsEmpty());
}

TEST(Mtl, wholly_transparent_materials_are_taken_as_opaque) {
  Scene scene;
  EXPECT_EQ(material_of(parse_one("Tr 1\n"), scene).base_color.w, 1.0f);
  ASSERT_EQ(scene.warnings.size(), 1u);
  EXPECT_EQ(scene.warnings[0].code, "assumed-opaque");
}

}  // namespace
}  // namespace voxeld
