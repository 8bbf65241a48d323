#include <gmock/gmock.h>

#include "tests/unit/scene/scene_test_util.h"
#include "tests/unit/scene/zip_maker.h"

namespace voxeld {
namespace {

using test::load_text;
using test::MapBundle;

constexpr char kUnitSquare[] = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

Result<Scene> load_with(const MapBundle& bundle, std::string_view text) {
  return load_obj("a.obj", test::bytes_of(text), bundle, {.decode_images = false});
}

TEST(ObjMaterials, materials_give_colour_and_texture) {
  MapBundle bundle;
  bundle.add("two words.mtl",
             "newmtl red paint\nKd 1 0 0\nmap_Kd -s 2 3 -o 0.5 0 -clamp on tex.png\n"
             "newmtl unused\nmap_Kd other.png\n");
  bundle.add("tex.png", "x");
  const auto scene = load_with(bundle, std::string("mtllib two words.mtl\n") + kUnitSquare +
                                           "vt 1 1\nusemtl red paint\nf 1/1 2/1 3/1\n");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_THAT(scene->warnings, testing::IsEmpty());
  ASSERT_EQ(scene->materials.size(), 1u);
  EXPECT_EQ(scene->materials[0].name, "red paint");
  EXPECT_EQ(scene->materials[0].base_color, glm::vec4(1, 0, 0, 1));
  EXPECT_EQ(scene->materials[0].wrap_u, Wrap::kClamp);
  ASSERT_EQ(scene->materials[0].image, 0);
  EXPECT_EQ(scene->images[0].name, "tex.png");
  EXPECT_EQ(scene->parts[0].uvs[0], glm::vec2(2.5f, -2.0f));
  EXPECT_TRUE(scene->has_colors());
}

// A TGA of 32 bits a pixel, top row first.
std::string tga_of(int width, int height, std::initializer_list<std::array<uint8_t, 4>> rgba) {
  std::string bytes{0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  for (const int byte : {width, 0, height, 0, 32, 0x28}) bytes += static_cast<char>(byte);
  for (const auto& [r, g, b, a] : rgba) {
    for (const uint8_t byte : {b, g, r, a}) bytes += static_cast<char>(byte);
  }
  return bytes;
}

TEST(ObjMaterials, maps_of_opacity_become_the_textures_alpha) {
  MapBundle bundle;
  bundle.add("a.mtl",
             "newmtl leaf\nmap_Kd skin.tga\nmap_d holes.tga\n"
             "newmtl same\nmap_Kd holes.tga\nmap_d holes.tga\n"
             "newmtl grey\nmap_Kd skin.tga\nmap_d grey.tga\n"
             "newmtl red\nmap_Kd skin.tga\nmap_d -imfchan r grey.tga\n"
             "newmtl alone\nmap_d holes.tga\n"
             "newmtl gone\nmap_Kd skin.tga\nmap_d gone.tga\n"
             "newmtl fine\nmap_Kd swatch.tga\nmap_d fine.tga\n"
             "newmtl cross\nmap_Kd row.tga\nmap_d holes.tga\n");
  bundle.add("skin.tga",
             tga_of(2, 2, {{1, 2, 3, 255}, {4, 5, 6, 255}, {7, 8, 9, 255}, {1, 1, 1, 255}}));
  bundle.add("holes.tga", tga_of(1, 2, {{9, 9, 9, 0}, {9, 9, 9, 200}}));
  bundle.add("grey.tga", tga_of(2, 1, {{90, 90, 90, 255}, {255, 0, 0, 255}}));
  bundle.add("swatch.tga", tga_of(1, 1, {{5, 6, 7, 255}}));
  bundle.add("fine.tga",
             tga_of(2, 2, {{9, 9, 9, 0}, {9, 9, 9, 255}, {9, 9, 9, 255}, {9, 9, 9, 0}}));
  bundle.add("row.tga", tga_of(2, 1, {{1, 2, 3, 255}, {4, 5, 6, 255}}));
  std::string text = std::string("mtllib a.mtl\n") + kUnitSquare + "vt 1 1\n";
  for (const char* name : {"leaf", "same", "grey", "red", "alone", "gone", "fine", "cross"}) {
    text += "usemtl " + std::string(name) + "\nf 1/1 2/1 3/1\n";
  }
  const auto scene = load_obj("a.obj", test::bytes_of(text), bundle, {});
  ASSERT_TRUE(scene) << scene.error().message();
  const auto texels = [&](size_t material) {
    return scene->images.at(static_cast<size_t>(scene->materials.at(material).image)).rgba;
  };
  using Bytes = std::vector<uint8_t>;
  EXPECT_EQ(texels(0), (Bytes{1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 9, 200, 1, 1, 1, 200}));
  EXPECT_EQ(texels(1), (Bytes{9, 9, 9, 0, 9, 9, 9, 200}));
  EXPECT_EQ(texels(2), (Bytes{1, 2, 3, 90, 4, 5, 6, 53, 7, 8, 9, 90, 1, 1, 1, 53}));
  EXPECT_EQ(texels(3), (Bytes{1, 2, 3, 90, 4, 5, 6, 255, 7, 8, 9, 90, 1, 1, 1, 255}));
  EXPECT_EQ(texels(4), (Bytes{255, 255, 255, 0, 255, 255, 255, 200}));
  EXPECT_EQ(texels(5), (Bytes{1, 2, 3, 255, 4, 5, 6, 255, 7, 8, 9, 255, 1, 1, 1, 255}));
  EXPECT_EQ(texels(6), (Bytes{5, 6, 7, 0, 5, 6, 7, 255, 5, 6, 7, 255, 5, 6, 7, 0}));
  EXPECT_EQ(texels(7), (Bytes{1, 2, 3, 0, 4, 5, 6, 0, 1, 2, 3, 200, 4, 5, 6, 200}));
  const Image& cross = scene->images.at(static_cast<size_t>(scene->materials.at(7).image));
  EXPECT_EQ(cross.width, 2);
  EXPECT_EQ(cross.height, 2);
  ASSERT_EQ(scene->missing_files.size(), 1u);
  EXPECT_EQ(scene->missing_files[0].name, "gone.tga");
}

TEST(ObjMaterials, options_of_map_d_count_where_it_is_alone) {
  const struct {
    const char* maps;
    glm::vec2 uv;
    Wrap wrap;
    const char* warning;
  } cases[] = {
      {"map_d -s 2 3 -o 0.5 0 -clamp on h.png", {2.5f, -2.0f}, Wrap::kClamp, nullptr},
      {"map_d -s 2 3 h.png\nmap_Kd -s 2 3 t.png", {2.0f, -2.0f}, Wrap::kRepeat, nullptr},
      {"map_d -s 4 4 -clamp on h.png\nmap_Kd -s 2 3 t.png",
       {2.0f, -2.0f},
       Wrap::kRepeat,
       "ignored-map-option: material \"a\": map_d: -s, -o and -clamp differ from those of map_Kd, "
       "which are used"}};
  for (const auto& [maps, uv, wrap, warning] : cases) {
    MapBundle bundle;
    bundle.add("a.mtl", std::string("newmtl a\n") + maps + "\n");
    bundle.add("h.png", "x");
    bundle.add("t.png", "x");
    const auto scene = load_with(
        bundle, std::string("mtllib a.mtl\n") + kUnitSquare + "vt 1 1\nusemtl a\nf 1/1 2/1 3/1\n");
    ASSERT_TRUE(scene) << scene.error().message();
    EXPECT_EQ(scene->parts.at(0).uvs.at(0), uv) << maps;
    EXPECT_EQ(scene->materials.at(0).wrap_u, wrap) << maps;
    EXPECT_EQ(test::warnings_of(*scene),
              warning == nullptr ? std::vector<std::string>() : std::vector<std::string>{warning});
  }
}

TEST(ObjMaterials, one_line_may_name_several_material_files) {
  MapBundle bundle;
  bundle.add("a.mtl", "newmtl a\nKd 1 0 0\n");
  bundle.add("b.mtl", "newmtl b\nKd 0 1 0\n");
  const auto scene = load_with(bundle, std::string("mtllib a.mtl b.mtl\n") + kUnitSquare +
                                           "usemtl b\nf 1 2 3\nusemtl a\nf 1 2 4\n");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_THAT(scene->warnings, testing::IsEmpty());
  EXPECT_EQ(scene->materials[0].base_color, glm::vec4(0, 1, 0, 1));
  EXPECT_EQ(scene->materials[1].base_color, glm::vec4(1, 0, 0, 1));
}

TEST(ObjMaterials, comments_may_follow_names) {
  MapBundle bundle;
  bundle.add("a.mtl",
             "newmtl red # the doors\nKd 1 0 0 # bright\nmap_Kd tex.png # of the doors\n"
             "newmtl Material #25\nKd 0 1 0\nmap_Kd skin #2.png\n"
             "newmtl blue\nKd 0 0 1\n");
  bundle.add("tex.png", "x");
  bundle.add("skin #2.png", "x");
  const auto scene = load_with(
      bundle, std::string("mtllib a.mtl # made by hand in b.mtl\n") + kUnitSquare +
                  "o door # the left one\nusemtl red\nf 1 2 3\nusemtl red # again\nf 1 2 4\n"
                  "g all # of them\nusemtl Material #25\nf 1 3 4\nusemtl blue #sky\nf 2 3 4\n");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_THAT(scene->warnings, testing::IsEmpty());
  EXPECT_THAT(scene->missing_files, testing::IsEmpty());
  ASSERT_EQ(scene->materials.size(), 3u);
  EXPECT_EQ(scene->materials[0].name, "red");
  EXPECT_EQ(scene->materials[0].base_color, glm::vec4(1, 0, 0, 1));
  EXPECT_EQ(scene->images.at(0).name, "tex.png");
  EXPECT_EQ(scene->materials[1].name, "Material #25");
  EXPECT_EQ(scene->images.at(1).name, "skin #2.png");
  EXPECT_EQ(scene->materials[2].base_color, glm::vec4(0, 0, 1, 1));
  EXPECT_THAT(scene->meshes, testing::ElementsAre("door"));
  EXPECT_THAT(scene->groups, testing::ElementsAre("", "all"));
}

// By their folders two names look like one path that ends in the second one.

TEST(ObjMaterials, several_names_with_blanks_and_folders_are_separated) {
  const std::pair<const char*, std::vector<const char*>> cases[] = {
      {"mats/a.mtl mats/b.mtl", {"mats/a.mtl", "mats/b.mtl"}},
      {"my own.mtl mats/b.mtl", {"my own.mtl", "mats/b.mtl"}},
      {"C:\\My Files\\my own.MTL \t b.mtl", {"my own.mtl", "mats/b.mtl"}},
      {"a.mtl # b.mtl", {"a.mtl"}},
      {"one.txt two.txt", {"one.txt", "two.txt"}},
      {"a b c", {"a b c"}},
      {"set #1.mtl b.mtl # and more", {"set #1.mtl", "b.mtl"}}};
  for (const auto& [line, files] : cases) {
    test::ZipMaker zip;
    std::string text = "mtllib " + std::string(line) + "\n" + kUnitSquare;
    for (size_t i = 0; i < files.size(); ++i) {
      const std::string name = "m" + std::to_string(i);
      zip.add(files[i], "newmtl " + name + "\nKd 1 0 0\n");
      text += "usemtl " + name + "\nf 1 2 3\n";
    }
    const std::string bytes = zip.add("a.obj", text).bytes();
    const auto scene = load_text("a.zip", bytes);
    ASSERT_TRUE(scene) << line << scene.error().message();
    const bool is_of_a_disk = std::string_view(line).starts_with("C:");
    EXPECT_EQ(scene->warnings.size(), is_of_a_disk ? 2u : 0u) << line;
    for (const Material& material : scene->materials) {
      EXPECT_EQ(material.base_color, glm::vec4(1, 0, 0, 1)) << line << ": " << material.name;
    }
  }
}

TEST(ObjMaterials, a_library_that_every_object_names_again_is_missed_once) {
  std::string text = kUnitSquare;
  for (int i = 0; i < 50; ++i) text += "mtllib gone for ever.mtl # it is\nf 1 2 3\n";
  const auto scene = load_text("a.obj", text);
  ASSERT_TRUE(scene) << scene.error().message();
  ASSERT_EQ(scene->warnings.size(), 1u);
  EXPECT_EQ(scene->warnings[0].detail, "gone for ever.mtl, named by a.obj, is not in the upload");
}

TEST(ObjMaterials, options_that_are_not_known_are_no_part_of_a_texture_s_name) {
  MapBundle bundle;
  bundle.add("a.mtl",
             "newmtl a\nmap_Kd -newoption 3 -other on my skin.png\n"
             "newmtl b\nmap_Kd -option gone.png\nnewmtl c\nmap_Kd -dash.png\n");
  bundle.add("my skin.png", "x");
  bundle.add("-dash.png", "x");
  const auto scene = load_with(bundle, std::string("mtllib a.mtl\n") + kUnitSquare +
                                           "usemtl a\nf 1 2 3\nusemtl b\nf 1 2 4\n"
                                           "usemtl c\nf 1 2 4\n");
  ASSERT_TRUE(scene) << scene.error().message();
  ASSERT_EQ(scene->images.size(), 2u);
  EXPECT_EQ(scene->images[0].name, "my skin.png");
  EXPECT_EQ(scene->images[1].name, "-dash.png");
  ASSERT_EQ(scene->missing_files.size(), 1u);
  EXPECT_EQ(scene->missing_files[0].name, "-option gone.png");
}

TEST(ObjMaterials, each_missing_file_is_named_once) {
  MapBundle bundle;
  bundle.add("a.mtl", "newmtl a\nmap_Kd .\\gone.png\nnewmtl b\nmap_Kd .\\gone.png\n");
  const auto scene =
      load_with(bundle, std::string("mtllib a.mtl none.mtl\n") + kUnitSquare +
                            "usemtl a\nf 1 2 3\nusemtl b\nf 1 2 4\nusemtl c\nf 1 3 4\n"
                            "usemtl a\nf 2 3 4\n");
  ASSERT_TRUE(scene) << scene.error().message();
  ASSERT_EQ(scene->warnings.size(), 3u);
  EXPECT_EQ(scene->warnings[0].code, "missing-material-file");
  EXPECT_EQ(scene->warnings[0].detail, "none.mtl, named by a.obj, is not in the upload");
  EXPECT_EQ(scene->warnings[1].code, "missing-texture");
  EXPECT_EQ(scene->warnings[1].detail,
            ".\\gone.png, named by material \"a\", is not in the upload");
  EXPECT_EQ(scene->warnings[2].code, "missing-material");
  EXPECT_EQ(scene->warnings[2].detail,
            "a.obj: material \"c\" is in none of its material files; taken as white");
  ASSERT_EQ(scene->missing_files.size(), 2u);
  EXPECT_EQ(scene->missing_files[1].name, ".\\gone.png");
  EXPECT_EQ(scene->missing_files[1].needed_by, "material \"a\"");
  EXPECT_FALSE(scene->has_colors()) << "no Kd, no texture: no colour";
}

TEST(ObjMaterials, files_under_other_names_are_taken_with_a_warning) {
  const std::string zip =
      test::ZipMaker()
          .add("wall.mtl",
               "newmtl a\nmap_Kd Textures\\\\BRICK.PNG\nnewmtl b\n"
               "map_Kd C:\\Users\\me\\Skin.png\nnewmtl c\nmap_Kd K\xf6rper.png\n")
          .add("textures/brick.png", "x")
          .add("Skin.png", "x")
          .add("K\x94rper.png", "x")
          .add("a.obj", std::string("mtllib Wall.MTL\n") + kUnitSquare +
                            "usemtl a\nf 1 2 3\nusemtl b\nf 1 2 4\nusemtl c\nf 1 3 4\n")
          .bytes();
  const auto scene = load_text("a.zip", zip);
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_TRUE(scene->missing_files.empty());
  EXPECT_EQ(scene->images.size(), 3u);
  std::vector<std::string> details;
  for (const Warning& warning : scene->warnings) {
    EXPECT_EQ(warning.code, "assumed-file");
    details.push_back(warning.detail);
  }
  EXPECT_THAT(
      details,
      testing::ElementsAre(
          "Wall.MTL, named by a.obj: wall.mtl is taken for it (the same name in another case)",
          "Textures\\\\BRICK.PNG, named by material \"a\": textures/brick.png is taken for it (the "
          "same name in another case)",
          "C:\\Users\\me\\Skin.png, named by material \"b\": Skin.png is taken for it (the end of "
          "the path)",
          "K\xf6rper.png, named by material \"c\": K\xc3\xb6rper.png is taken for it (read as "
          "CP1252 and CP850)"));
}

TEST(ObjMaterials, a_broken_texture_is_a_warning) {
  MapBundle bundle;
  bundle.add("a.mtl", "newmtl a\nmap_Kd t.png\n");
  bundle.add("t.png", "");
  const auto scene = load_obj(
      "a.obj", test::bytes_of(std::string("mtllib a.mtl\n") + kUnitSquare + "usemtl a\nf 1 2 3\n"),
      bundle, {});
  ASSERT_TRUE(scene) << scene.error().message();
  ASSERT_EQ(scene->warnings.size(), 1u);
  EXPECT_EQ(scene->warnings[0].code, "broken-texture");
  EXPECT_THAT(scene->warnings[0].detail, testing::StartsWith("t.png, named by material \"a\": "));
  ASSERT_EQ(scene->missing_files.size(), 1u);
}

TEST(ObjMaterials, the_only_image_of_a_bundle_is_taken_where_no_texture_is_named) {
  MapBundle bundle;
  bundle.add("spot.obj", "");
  bundle.add("__MACOSX/._t.png", "");
  bundle.add("Texture.PNG", "x");
  const std::string mesh = std::string(kUnitSquare) + "vt 0 0\nf 1/1 2/1 3/1\nf 1 2 4\n";
  const auto scene = load_with(bundle, mesh);
  ASSERT_TRUE(scene) << scene.error().message();
  ASSERT_EQ(scene->warnings.size(), 1u);
  EXPECT_EQ(scene->warnings[0].code, "assumed-texture");
  EXPECT_EQ(scene->warnings[0].detail,
            "a.obj names no texture; Texture.PNG, the only image of the upload, is used");
  ASSERT_EQ(scene->parts.size(), 2u);
  EXPECT_EQ(scene->parts[0].material, 0);
  EXPECT_EQ(scene->parts[1].material, -1) << "no texture coordinates";
  EXPECT_EQ(scene->materials[0].image, 0);
  bundle.add("second.jpg", "x");
  EXPECT_THAT(load_with(bundle, mesh)->warnings, testing::IsEmpty());
}

TEST(ObjMaterials, the_only_image_is_no_colour_where_a_material_file_uses_it_otherwise) {
  const std::string mesh =
      std::string("mtllib a.mtl\n") + kUnitSquare + "vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n";
  for (const char* materials :
       {"newmtl a\nKd 1 0 0\nmap_Bump -bm 1.0 my normal.png\n", "newmtl a\nnorm my normal.png\n",
        "newmtl a\nKd 1 1 1\nnewmtl unused\nmap_Kd my normal.png\n"}) {
    MapBundle bundle;
    bundle.add("a.mtl", materials);
    bundle.add("my normal.png", "x");
    const auto scene = load_with(bundle, mesh);
    ASSERT_TRUE(scene) << scene.error().message();
    EXPECT_THAT(scene->warnings, testing::IsEmpty()) << materials;
    EXPECT_THAT(scene->images, testing::IsEmpty()) << materials;
  }
  MapBundle renamed;
  renamed.add("a.mtl", "newmtl b\nmap_Kd skin.png\n");
  renamed.add("skin.png", "x");
  EXPECT_EQ(load_with(renamed, mesh)->images.size(), 1u) << "material a is not there";
}

TEST(ObjMaterials, under_a_texture_vertex_colours_do_not_count) {
  MapBundle bundle;
  bundle.add("a.mtl", "newmtl a\nmap_Kd skin.png\nnewmtl b\nmap_Kd gone.png\n");
  bundle.add("skin.png", "x");
  const auto scene = load_with(bundle,
                               "mtllib a.mtl\nv 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nvt 0 0\n"
                               "usemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 2/1 3/1\n");
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_THAT(scene->parts.at(0).colors, testing::IsEmpty());
  EXPECT_EQ(scene->parts.at(1).colors.size(), 3u) << "its texture is missing";
  EXPECT_EQ(scene->warnings.back().code, "ignored-colors");
}

}  // namespace
}  // namespace voxeld
