// 3MF packages.
#include <gmock/gmock.h>

#include "server/scene/load.h"
#include "tests/unit/base/points_passed.h"
#include "tests/unit/scene/scene_test_util.h"
#include "tests/unit/scene/zip_maker.h"

namespace voxeld {
namespace {

using test::load_text;
using test::message_of;
using test::ZipMaker;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr char kTetrahedron[] = R"(<mesh>
<vertices>
<vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/>
<vertex x="0" y="0" z="1"/>
</vertices>
<triangles>
<triangle v1="0" v2="2" v3="1"/><triangle v1="0" v2="1" v3="3"/>
<triangle v1="0" v2="3" v3="2"/><triangle v1="1" v2="2" v3="3"/>
</triangles></mesh>)";

std::string model(const std::string& resources, const std::string& build,
                  const std::string& attributes = "") {
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
         "<model unit=\"millimeter\" "
         "xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\" "
         "xmlns:m=\"http://schemas.microsoft.com/3dmanufacturing/material/2015/02\" "
         "xmlns:p=\"http://schemas.microsoft.com/3dmanufacturing/production/2015/06\" "
         "xmlns:b=\"http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02\" " +
         attributes + ">\n<resources>" + resources + "</resources>\n<build>" + build +
         "</build></model>";
}

std::string object(const std::string& id, const std::string& content,
                   const std::string& attributes = "") {
  return "<object id=\"" + id + "\" " + attributes + ">" + content + "</object>";
}

ZipMaker package(const std::string& text) {
  return ZipMaker()
      .add("[Content_Types].xml", "<Types/>")
      .add("_rels/.rels",
           "<Relationships "
           "xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\">"
           "<Relationship Target=\"/Metadata/thumbnail.png\" Id=\"r2\" Type=\"thumbnail\"/>"
           "<Relationship Target=\"/3D/3dmodel.model\" Id=\"r1\" "
           "Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/>"
           "</Relationships>")
      .add("3D/3dmodel.model", text);
}

Result<Scene> load(const std::string& text) {
  return load_text("a.3mf", package(text).bytes());
}

std::vector<std::string> codes(const Scene& scene) {
  std::vector<std::string> out;
  for (const Warning& warning : scene.warnings) out.push_back(warning.code);
  return out;
}

TEST(ThreeMf, objects_of_the_build_stand_where_their_items_put_them) {
  const auto scene =
      load(model(object("7", kTetrahedron, "name=\"tetra\""),
                 "<item objectid=\"7\"/>"
                 "<item objectid=\"7\" transform=\"0 2 0 -2 0 0 0 0 2 10 20 30\"/>"));
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->format, "3mf");
  EXPECT_EQ(scene->triangle_count(), 8u);
  EXPECT_THAT(scene->meshes, ElementsAre("tetra"));
  EXPECT_THAT(scene->nodes, ElementsAre("item 0", "item 1"));
  EXPECT_THAT(scene->warnings, IsEmpty());
  EXPECT_FALSE(scene->has_colors());
  ASSERT_EQ(scene->parts.size(), 2u);
  // Corners in the order of their first use: 0, 2, 1, 3. Row vectors: x goes to y, y to -x.
  EXPECT_THAT(scene->parts[0].indices, ElementsAre(0, 1, 2, 0, 2, 3, 0, 3, 1, 2, 1, 3));
  EXPECT_EQ(scene->parts[1].positions[0], glm::dvec3(10, 20, 30));
  EXPECT_EQ(scene->parts[1].positions[1], glm::dvec3(8, 20, 30));
  EXPECT_EQ(scene->parts[1].positions[2], glm::dvec3(10, 22, 30));
  EXPECT_EQ(scene->parts[1].positions[3], glm::dvec3(10, 20, 32));
}

TEST(ThreeMf, a_long_name_costs_each_part_little) {
  const std::string name(5000, 'x');
  const auto scene =
      load(model(object("7", kTetrahedron, "name=\"" + name + "\""), "<item objectid=\"7\"/>"));
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->parts.at(0).name, name.substr(0, 1024));
  EXPECT_THAT(scene->meshes, ElementsAre(name));
}

TEST(ThreeMf, components_are_placed_inside_each_other_and_a_mirror_turns_triangles_around) {
  const auto scene = load(model(
      object("1", kTetrahedron) +
          object("2",
                 "<components><component objectid=\"1\" transform=\"1 0 0 0 1 0 0 0 1 5 0 0\"/>"
                 "</components>") +
          object("3",
                 "<components><component objectid=\"2\" "
                 "transform=\"-1 0 0 0 1 0 0 0 1 0 0 0\"/></components>"),
      "<item objectid=\"3\" transform=\"1 0 0 0 1 0 0 0 1 0 0 100\"/>"));
  ASSERT_TRUE(scene) << scene.error().message();
  const MeshPart& part = scene->parts.at(0);
  EXPECT_EQ(part.positions[0], glm::dvec3(-5, 0, 100));
  // The first triangle is 0 2 1 in the file, and 0 1 2 in the mirror.
  EXPECT_EQ(part.positions[1], glm::dvec3(-6, 0, 100));
  EXPECT_EQ(part.positions[2], glm::dvec3(-5, 1, 100));
}

TEST(ThreeMf, base_materials_are_materials_with_their_names) {
  std::string mesh = kTetrahedron;
  mesh.replace(mesh.find("<triangle v1=\"0\" v2=\"1\""), 9, "<triangle pid=\"5\" p1=\"1\"");
  const auto scene =
      load(model("<basematerials id=\"5\"><base name=\"red\" displaycolor=\"#FF0000\"/>"
                 "<base name=\"glass\" displaycolor=\"#0000ff80\"/></basematerials>" +
                     object("1", mesh, "pid=\"5\" pindex=\"0\""),
                 "<item objectid=\"1\"/>"));
  ASSERT_TRUE(scene) << scene.error().message();
  ASSERT_EQ(scene->materials.size(), 2u);
  EXPECT_EQ(scene->materials[0].name, "red");
  EXPECT_EQ(scene->materials[0].base_color, glm::vec4(1, 0, 0, 1));
  EXPECT_EQ(scene->materials[1].base_color, glm::vec4(0, 0, 1, 128.0f / 255.0f));
  ASSERT_EQ(scene->parts.size(), 2u);
  EXPECT_EQ(scene->parts[0].indices.size(), 9u);
  EXPECT_EQ(scene->parts[1].indices.size(), 3u);
  EXPECT_EQ(scene->parts[1].material, 1);
  EXPECT_TRUE(scene->has_colors());
}

TEST(ThreeMf, colours_of_corners_are_vertex_colours) {
  const std::string mesh =
      "<mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/><vertex x=\"1\" y=\"0\" z=\"0\"/>"
      "<vertex x=\"0\" y=\"1\" z=\"0\"/></vertices><triangles>"
      "<triangle v1=\"0\" v2=\"1\" v3=\"2\" pid=\"2\" p1=\"0\" p2=\"1\" p3=\"0\"/>"
      "<triangle v1=\"0\" v2=\"2\" v3=\"1\" pid=\"2\" p1=\"1\"/>"
      "</triangles></mesh>";
  const auto scene =
      load(model("<m:colorgroup id=\"2\"><m:color color=\"#FFFFFF\"/><m:color color=\"#00FF00\"/>"
                 "</m:colorgroup>" +
                     object("1", mesh),
                 "<item objectid=\"1\"/>"));
  ASSERT_TRUE(scene) << scene.error().message();
  const MeshPart& part = scene->parts.at(0);
  const glm::vec4 white(1), green(0, 1, 0, 1);
  EXPECT_THAT(part.colors, ElementsAre(white, green, white, green, green));
  EXPECT_THAT(part.indices, ElementsAre(0, 1, 2, 3, 4, 1));
}

TEST(ThreeMf, textures_come_from_the_package_with_v_upwards) {
  const std::string mesh =
      "<mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/><vertex x=\"1\" y=\"0\" z=\"0\"/>"
      "<vertex x=\"0\" y=\"1\" z=\"0\"/></vertices><triangles>"
      "<triangle v1=\"0\" v2=\"1\" v3=\"2\" pid=\"3\" p1=\"0\" p2=\"1\" "
      "p3=\"2\"/></triangles></mesh>";
  const std::string text = model(
      "<m:texture2d id=\"2\" path=\"/3D/Textures/skin.tga\" contenttype=\"image/png\" "
      "tilestyleu=\"clamp\" tilestylev=\"mirror\"/>"
      "<m:texture2dgroup id=\"3\" texid=\"2\"><m:tex2coord u=\"0\" v=\"0\"/>"
      "<m:tex2coord u=\"1\" v=\"0\"/><m:tex2coord u=\"0\" v=\"0.75\"/></m:texture2dgroup>" +
          object("1", mesh),
      "<item objectid=\"1\"/>");
  const std::string tga("\0\0\2\0\0\0\0\0\0\0\0\0\1\0\1\0\x18\0\3\2\1", 21);
  const auto scene = load_text("a.3mf", package(text).add("3D/Textures/skin.tga", tga).bytes());
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_THAT(scene->parts.at(0).uvs,
              ElementsAre(glm::vec2(0, 1), glm::vec2(1, 1), glm::vec2(0, 0.25f)));
  ASSERT_EQ(scene->images.size(), 1u);
  EXPECT_EQ(scene->images[0].name, "3D/Textures/skin.tga");
  EXPECT_EQ(scene->materials.at(0).wrap_u, Wrap::kClamp);
  EXPECT_EQ(scene->materials.at(0).wrap_v, Wrap::kMirror);
  const auto missing = load(text);
  ASSERT_TRUE(missing);
  EXPECT_THAT(codes(*missing), ElementsAre("missing-texture"));
}

TEST(ThreeMf, objects_may_be_in_other_parts_of_the_package) {
  const std::string other = model(object("4", kTetrahedron), "");
  const std::string start =
      model(object("1",
                   "<components><component p:path=\"/3D/Objects/one.model\" objectid=\"4\"/>"
                   "</components>"),
            "<item objectid=\"1\"/>", "requiredextensions=\"p\"");
  const auto scene = load_text("a.3mf", package(start).add("3D/Objects/one.model", other).bytes());
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->triangle_count(), 4u);
  EXPECT_EQ(message_of(load(start)),
            "3D/3dmodel.model line 3: the model part is not in the package: expected one of its "
            "files, got \"3D/Objects/one.model\"");
}

TEST(ThreeMf, supports_are_left_out_and_other_extensions_named) {
  const auto scene =
      load(model(object("1", kTetrahedron) + object("2", kTetrahedron, "type=\"support\"") +
                     "<b:beamlattice/><m:compositematerials id=\"9\"/>",
                 "<item objectid=\"1\"/><item objectid=\"2\"/>"));
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->triangle_count(), 4u);
  EXPECT_THAT(codes(*scene),
              ElementsAre("ignored-extension", "ignored-extension", "skipped-object"));
}

TEST(ThreeMf, a_model_part_alone_is_a_mesh_file) {
  const auto scene =
      load_text("loose.model", model(object("1", kTetrahedron), "<item objectid=\"1\"/>"));
  ASSERT_TRUE(scene) << scene.error().message();
  EXPECT_EQ(scene->format, "3mf");
}

struct Case {
  const char* what;
  std::string text, error;
};

TEST(ThreeMf, errors_have_the_line) {
  const std::string in = "3D/3dmodel.model ";
  const std::string item = "<item objectid=\"1\"/>";
  const auto triangle = [](const std::string& attributes) {
    return object("1",
                  "<mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/></vertices><triangles>\n"
                  "<triangle " +
                      attributes + "/></triangles></mesh>");
  };
  const Case cases[] = {
      {"not XML", "<model", "malformed"},
      {"corner", model(triangle("v1=\"0\" v2=\"0\" v3=\"1\""), item),
       in + "object 1: index of a vertex: expected 0, got 1"},
      {"no corner", model(triangle("v1=\"0\" v2=\"0\""), item),
       in + "line 4: triangle v3: expected an integer from 0 to 2147483647, got nothing"},
      {"coordinate",
       model(object("1",
                    "<mesh><vertices><vertex x=\"1e31\" y=\"0\" z=\"0\"/>"
                    "</vertices></mesh>"),
             item),
       in + "line 3: vertex x: expected a finite number up to 1e30, got \"1e31\""},
      {"transform", model(object("1", kTetrahedron), "<item objectid=\"1\" transform=\"1 0\"/>"),
       in + "line 12: item transform: expected twelve numbers, got \"1 0\""},
      {"object", model(object("2", kTetrahedron), item),
       in + "line 12: objectid: expected an object of 3D/3dmodel.model, got 1"},
      {"twice", model(object("1", kTetrahedron) + object("1", kTetrahedron), item),
       in + "line 11: object id: expected one that no other object has, got 1"},
      {"colour",
       model("<basematerials id=\"5\"><base name=\"a\" displaycolor=\"red\"/>"
             "</basematerials>",
             item),
       in + "line 3: base displaycolor: expected #RRGGBB or #RRGGBBAA, got \"red\""},
      {"property",
       model("<basematerials id=\"5\"><base name=\"a\" displaycolor=\"#000000\"/>"
             "</basematerials>" +
                 object("1", kTetrahedron, "pid=\"5\" pindex=\"1\""),
             item),
       in + "group 5: index of a property: expected 0, got 1"},
      {"cycle", model(object("1", "<components><component objectid=\"1\"/></components>"), item),
       in + "line 3: depth of components: expected at most 64, got 65"},
      {"empty", model("", ""),
       "3D/3dmodel.model: the mesh is empty: expected at least one "
       "triangle, got no item in the build"},
      {"extension", model(object("1", kTetrahedron), item, "requiredextensions=\"b\""),
       in + "line 2: model requires an extension: expected materials or production, got "
            "\"http://schemas.microsoft.com/3dmanufactu…\""},
  };
  for (const Case& one : cases) {
    SCOPED_TRACE(one.what);
    const auto scene = load(one.text);
    ASSERT_FALSE(scene);
    if (std::string(one.what) == "not XML") continue;
    EXPECT_THAT(scene.error().message(), HasSubstr(one.error.substr(one.error.find(':') + 1)));
  }
}

TEST(ThreeMf, entities_are_refused_before_they_expand) {
  const std::string bomb =
      "<?xml version=\"1.0\"?><!DOCTYPE model [<!ENTITY a \"aaaaaaaaaa\"><!ENTITY b "
      "\"&a;&a;&a;&a;&a;&a;&a;&a;\">]><model "
      "xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\">&b;</model>";
  EXPECT_THAT(message_of(load(bomb)), HasSubstr("a document type declaration"));
}

TEST(ThreeMf, components_that_double_at_each_level_are_bounded) {
  std::string resources = object("1", "<mesh/>");
  for (int i = 2; i <= 40; ++i) {
    const std::string component = "<component objectid=\"" + std::to_string(i - 1) + "\"/>";
    resources +=
        object(std::to_string(i), "<components>" + component + component + "</components>");
  }
  EXPECT_THAT(message_of(load(model(resources, "<item objectid=\"40\"/>"))),
              HasSubstr("objects of the build: expected at most 1048576"));
}

TEST(ThreeMf, each_vertex_can_be_cancelled_wherever_its_object_is_placed) {
  const auto points = [](int more_vertices) {
    std::string mesh = kTetrahedron;
    for (int i = 0; i < more_vertices; ++i) {
      mesh.insert(mesh.find("</vertices>"), "<vertex x=\"0\" y=\"0\" z=\"0\"/>");
    }
    const std::string text = model(object("1", mesh), "<item objectid=\"1\"/>");
    return test::points_passed([&] { EXPECT_TRUE(load(text).ok()); });
  };
  // One for each vertex, and five where their list grows.
  EXPECT_GE(points(200), points(0) + 200 + 5);
}

TEST(ThreeMf, every_truncation_is_an_error) {
  const std::string text = model(object("1", kTetrahedron), "<item objectid=\"1\"/>");
  for (size_t bytes = 0; bytes < text.size(); ++bytes) {
    EXPECT_FALSE(load(text.substr(0, bytes))) << bytes;
  }
}

// As PrusaSlicer writes a modifier: in the mesh of its object.
TEST(ThreeMf, volumes_that_only_help_the_slicer_are_left_out) {
  const std::string text = model(object("1", kTetrahedron), "<item objectid=\"1\"/>");
  const auto load_with = [&](const std::string& metadata) {
    return load_text("a.3mf",
                     package(text)
                         .add("Metadata/Slic3r_PE_model.config",
                              "<config><object id=\"1\"><volume firstid=\"0\" lastid=\"2\">"
                              "<metadata type=\"volume\" key=\"volume_type\" value=\"ModelPart\"/>"
                              "</volume><volume firstid=\"3\" lastid=\"3\">" +
                                  metadata + "</volume></object></config>")
                         .bytes());
  };
  for (const char* type : {"ParameterModifier", "NegativeVolume", "SupportBlocker"}) {
    const auto scene = load_with("<metadata type=\"volume\" key=\"volume_type\" value=\"" +
                                 std::string(type) + "\"/>");
    ASSERT_TRUE(scene) << scene.error().message();
    EXPECT_EQ(scene->triangle_count(), 3u) << type;
    EXPECT_THAT(codes(*scene), ElementsAre("skipped-object"));
  }
  EXPECT_EQ(load_with("<metadata type=\"volume\" key=\"modifier\" value=\"1\"/>")->triangle_count(),
            3u);
  EXPECT_EQ(load_with("<broken")->triangle_count(), 4u);
}

}  // namespace
}  // namespace voxeld
