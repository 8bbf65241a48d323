#include "server/worker/mesh/inspect.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>

#include "server/scene/load.h"

namespace voxeld {
namespace {

using nlohmann::json;

AnimatedScene still(const Scene& scene) {
  AnimatedScene animated;
  animated.scene = scene;
  return animated;
}

TEST(Inspect, a_description_names_counts_bounds_parts_materials_and_missing_files) {
  Scene scene;
  scene.format = "obj";
  MeshPart part;
  part.name = "leaf";
  part.material = 0;
  part.positions = {{0, 0, 0}, {2, 0, 0}, {0, 3, -1}};
  part.indices = {0, 1, 2};
  scene.parts.push_back(part);
  Material material;
  material.name = "bark";
  material.image = 0;
  scene.materials.push_back(material);
  Image image;
  image.name = "bark.png";
  scene.images.push_back(image);
  scene.missing_files.push_back({"moss.png", "material moss"});

  const json description = describe_scene(still(scene));
  EXPECT_EQ(description["format"], "obj");
  EXPECT_EQ(description["triangles"], 1);
  EXPECT_EQ(description["vertices"], 3);
  EXPECT_EQ(description["bounds"]["min"], json({0.0, 0.0, -1.0}));
  EXPECT_EQ(description["bounds"]["max"], json({2.0, 3.0, 0.0}));
  EXPECT_EQ(description["parts"][0]["name"], "leaf");
  EXPECT_EQ(description["parts"][0]["material"], 0);
  EXPECT_EQ(description["parts"][0]["group"], "");
  EXPECT_EQ(description["group_count"], 1);
  EXPECT_EQ(description["materials"][0]["texture"], "bark.png");
  EXPECT_EQ(description["missing_files"][0]["name"], "moss.png");
  EXPECT_EQ(description["missing_files"][0]["needed_by"], "material moss");
  EXPECT_EQ(description["watertight"], false);
  EXPECT_EQ(description["open_edges"], 3);
  EXPECT_EQ(description["non_manifold_edges"], 0);
}

// A tetrahedron with as many vertices as each format needs for it.
std::string float_bytes(std::initializer_list<float> values) {
  std::string text;
  for (const float value : values) {
    for (size_t i = 0; i < 4; ++i) {
      char hex[8];
      std::snprintf(hex, sizeof hex, "%%%02x",
                    unsigned{reinterpret_cast<const unsigned char*>(&value)[i]});
      text += hex;
    }
  }
  return text;
}

json description_of(const std::string& filename, const std::string& text) {
  auto scene =
      load_scene(filename, {reinterpret_cast<const uint8_t*>(text.data()), text.size()}, {});
  EXPECT_TRUE(scene.ok()) << filename << ": " << (scene ? "" : scene.error().message());
  return scene ? describe_scene(still(*scene)) : json();
}

TEST(Inspect, vertices_are_the_same_number_in_every_format) {
  const std::string facet = "facet normal 0 0 0\nouter loop\n", end = "endloop\nendfacet\n";
  const std::string o = "vertex 0 0 0\n", x = "vertex 1 0 0\n", y = "vertex 0 1 0\n",
                    z = "vertex 0 0 1\n";
  const std::string gltf = R"({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 12, "type": "VEC3"}],
    "bufferViews": [{"buffer": 0, "byteLength": 144}], "buffers": [{"byteLength": 144,
    "uri": "data:application/octet-stream,)" +
                           float_bytes({0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1,
                                        0, 0, 0, 0, 0, 1, 0, 1, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}) +
                           "\"}]}";
  const std::pair<const char*, std::string> files[] = {
      {"a.obj",
       "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 9 9 9\nvn 0 0 -1\nvn 0 -1 0\nvn -1 0 0\nvn 1 1 1\n"
       "f 1//1 3//1 2//1\nf 1//2 2//2 4//2\nf 1//3 4//3 3//3\nf 2//4 3//4 4//4\n"},
      {"a.ply",
       "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\n"
       "property float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n"
       "0 0 0\n1 0 0\n0 1 0\n0 0 1\n9 9 9\n0 0 0\n3 0 2 1\n3 5 1 3\n3 0 3 2\n3 1 2 3\n"},
      {"a.stl", "solid a\n" + facet + o + y + x + end + facet + o + x + z + end + facet + o + z +
                    y + end + facet + x + y + z + end + "endsolid a\n"},
      {"a.off",
       "OFF\n5 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n9 9 9\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"},
      {"a.gltf", gltf}};
  for (const auto& [filename, text] : files) {
    const json description = description_of(filename, text);
    EXPECT_EQ(description["triangles"], 4) << filename;
    EXPECT_EQ(description["vertices"], 4) << filename;
    EXPECT_EQ(description["parts"][0]["vertices"], 4) << filename;
    EXPECT_EQ(description["meshes"][0]["vertices"], 4) << filename;
  }
}

TEST(Inspect, a_scene_with_too_many_parts_and_endless_names_stays_a_small_description) {
  Scene scene;
  MeshPart part;
  part.name = std::string(10'000, 'n');
  scene.parts.assign(5000, part);
  const json description = describe_scene(still(scene));
  EXPECT_EQ(description["part_count"], 5000);
  EXPECT_LT(description["parts"].size(), 5000u);
  EXPECT_LT(description.dump().size(), 400'000u);  // a task message holds 1 MiB
}

TEST(Inspect, ids_are_named_in_their_order_and_long_lists_shortly) {
  EXPECT_EQ(describe_ids({"a", ""}), json::parse(R"([{"id":1,"name":"a"},{"id":2,"name":""}])"));
  EXPECT_EQ(describe_ids({std::string(500, 'n')})[0]["name"], std::string(200, 'n'));
  // Names are UTF-8, whatever the file has, and where they are cut.
  EXPECT_EQ(describe_ids({"caf\xe9"})[0]["name"], std::string("caf\xef\xbf\xbd"));
  EXPECT_EQ(describe_ids({std::string(199, 'n') + "\xc3\xa9"})[0]["name"],
            std::string(199, 'n') + "\xef\xbf\xbd");
  const json many = describe_ids(std::vector<std::string>(65'535, std::string(500, 'n')));
  EXPECT_EQ(many.size(), 65'535u);
  EXPECT_EQ(many[65'534]["id"], 65'535);
  EXPECT_EQ(many[0]["name"], std::string(32, 'n'));
  EXPECT_LT(many.dump().size(), size_t{4} << 20);  // a task message holds 16 MiB
}

TEST(Inspect, unknown_members_of_a_mesh_are_null) {
  EXPECT_TRUE(describe_mesh(std::nullopt, std::nullopt)["open_edges"].is_null());
  MeshTopology topology;
  topology.open_edges = 3;
  topology.unbalanced_edges = 3;
  const json surface = describe_mesh(topology, std::nullopt);
  EXPECT_EQ(surface["open_edges"], 3);
  EXPECT_EQ(surface["watertight"], false);
  EXPECT_EQ(surface["closed"], false);
  EXPECT_TRUE(surface["inner_walls"].is_null());
  EXPECT_TRUE(surface["ambiguous_fraction"].is_null());
  FillStats fill;
  fill.ambiguous_fraction = 0.25;
  EXPECT_EQ(describe_mesh(topology, fill)["ambiguous_fraction"], 0.25);
  EXPECT_EQ(describe_fill(fill, topology)["open_edges"], 3);
}

TEST(Inspect, an_empty_scene_has_no_bounds) {
  EXPECT_TRUE(describe_scene(AnimatedScene{})["bounds"].is_null());
}

}  // namespace
}  // namespace voxeld
