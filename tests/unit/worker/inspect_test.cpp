#include "server/worker/inspect.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

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

TEST(Inspect, a_scene_with_too_many_parts_and_endless_names_stays_a_small_description) {
  Scene scene;
  MeshPart part;
  part.name = std::string(100'000, 'n');
  scene.parts.assign(5000, part);
  const json description = describe_scene(still(scene));
  EXPECT_EQ(description["part_count"], 5000);
  EXPECT_LT(description["parts"].size(), 5000u);
  EXPECT_LT(description.dump().size(), 400'000u);  // a task message holds 1 MiB
}

TEST(Inspect, ids_are_named_in_their_order_and_long_lists_shortly) {
  EXPECT_EQ(describe_ids({"a", ""}), json::parse(R"([{"id":1,"name":"a"},{"id":2,"name":""}])"));
  EXPECT_EQ(describe_ids({std::string(500, 'n')})[0]["name"], std::string(200, 'n'));
  const json many = describe_ids(std::vector<std::string>(65'535, std::string(500, 'n')));
  EXPECT_EQ(many.size(), 65'535u);
  EXPECT_EQ(many[65'534]["id"], 65'535);
  EXPECT_EQ(many[0]["name"], std::string(32, 'n'));
  EXPECT_LT(many.dump().size(), size_t{4} << 20);  // a task message holds 16 MiB
}

TEST(Inspect, what_is_not_known_of_a_mesh_is_null) {
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
