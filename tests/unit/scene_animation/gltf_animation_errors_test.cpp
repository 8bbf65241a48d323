// Errors of a glTF animation name their place; a static scene ignores them.
#include <gtest/gtest.h>

#include "server/scene/load.h"
#include "tests/unit/scene/scene_test_util.h"
#include "tests/unit/scene_animation/animation_fixtures.h"

namespace voxeld {
namespace {

std::string animated_message(const GltfBuilder& builder) {
  const std::string text = builder.text();
  return test::message_of(
      load_animated_scene("a.gltf", test::bytes_of(text), {.decode_images = false}));
}

// The message for the dancer with one value of its JSON replaced.
std::string with(const char* pointer, const Json& value) {
  GltfBuilder builder = dancer();
  builder.json[Json::json_pointer(pointer)] = value;
  EXPECT_EQ(outcome(builder.load()), "ok") << pointer;
  return animated_message(builder);
}

TEST(GltfAnimationErrors, the_schema_is_checked_with_paths) {
  EXPECT_EQ(with("/animations/0/channels/0/target/node", 99),
            "a.gltf animations[0].channels[0].target.node: wrong value: expected an index of one "
            "of 7 nodes, got 99");
  EXPECT_EQ(
      with("/animations/0/channels/0/target", Json::object()),
      "a.gltf animations[0].channels[0].target.path: is missing: expected a string, got nothing");
  EXPECT_EQ(with("/animations/1/samplers/2/input", -1),
            "a.gltf animations[1].samplers[2].input: wrong value: expected an index of one of " +
                std::to_string(dancer().json["accessors"].size()) + " accessors, got -1");
  EXPECT_EQ(with("/animations", 7), "a.gltf animations: wrong value: expected an array, got 7");
  EXPECT_EQ(with("/animations/0/channels", nullptr),
            "a.gltf animations[0].channels: wrong value: expected an array, got null");
}

TEST(GltfAnimationErrors, samplers_and_targets_are_checked) {
  EXPECT_EQ(with("/animations/0/channels/1/sampler", 3),
            "a.gltf animations[0].channels[1].sampler: wrong value: expected 0 to 2, got 3");
  EXPECT_EQ(with("/animations/0/samplers/0/interpolation", "HERMITE"),
            "a.gltf animations[0].samplers[0].interpolation: unknown interpolation: expected "
            "LINEAR, STEP or CUBICSPLINE, got \"HERMITE\"");
  EXPECT_EQ(with("/animations/0/samplers/0/interpolation", "LINEAR"),
            "a.gltf animations[0].samplers[0].output: elements: expected 3 for 3 keys, got 9");
  EXPECT_EQ(with("/animations/0/channels/1/target", Json{{"node", 2}, {"path", "translation"}}),
            "a.gltf animations[0].channels[1].target: two channels move one property of a node: "
            "expected one, got nodes[2]");
  EXPECT_EQ(with("/animations/0/channels/0/target/node", 4),
            "a.gltf animations[0].channels[0].target.node: an animated node has a matrix: expected "
            "translation, rotation and scale, got nodes[4].matrix");
}

TEST(GltfAnimationErrors, accessors_have_the_type_of_their_property) {
  const Json samplers = dancer().json["animations"][0]["samplers"];
  const auto name = [&](size_t i, const char* key) {
    return "accessors[" + std::to_string(samplers[i][key].get<int>()) + "]";
  };
  EXPECT_EQ(
      with("/animations/0/channels/1/sampler", 0),
      "a.gltf " + name(0, "output") + ".type: components of values of keys: expected 4, got 3");
  EXPECT_EQ(
      with("/animations/0/samplers/0/input", samplers[0]["output"]),
      "a.gltf " + name(0, "output") + ".type: components of times of keys: expected 1, got 3");
  const std::string times = "/accessors/" + std::to_string(samplers[0]["input"].get<int>());
  EXPECT_EQ(with((times + "/componentType").c_str(), 5125),
            "a.gltf " + name(0, "input") +
                ".componentType: component type of times of keys: expected 5126, got 5125");
  EXPECT_EQ(with((times + "/count").c_str(), 0),
            "a.gltf animations[0].samplers[0].input: no keys: expected 1 or more, got 0");
  EXPECT_EQ(with((times + "/count").c_str(), 2),
            "a.gltf animations[0].samplers[0].output: elements: expected 6 for 2 keys, got 9");
  EXPECT_EQ(
      with((times + "/byteOffset").c_str(), 4096),
      "a.gltf " + name(0, "input") + ": the elements lie outside of bufferViews[" +
          std::to_string(dancer().json[Json::json_pointer(times + "/bufferView")].get<int>()) +
          "]: expected at most 12 bytes, got 12 bytes from byte 4096");
}

TEST(GltfAnimationErrors, numbers_are_finite_and_times_ascend) {
  const auto with_times = [](const std::vector<float>& times) {
    GltfBuilder builder = dancer();
    builder.json["animations"][0]["samplers"][0]["input"] = builder.add_floats(times, "SCALAR");
    return animated_message(builder);
  };
  EXPECT_EQ(
      with_times({0, 2, 1}),
      "a.gltf animations[0].samplers[0].input: time of key 2: expected finite, and not before "
      "the key in front, got 1.000000");
  EXPECT_EQ(
      with_times({0, 1, std::nanf("")}),
      "a.gltf animations[0].samplers[0].input: time of key 2: expected finite, and not before "
      "the key in front, got not finite");
  EXPECT_EQ(with_times({0, 1, 1}), "ok");
  GltfBuilder builder = dancer();
  std::vector<float> values(27, 1.0f);
  values[13] = INFINITY;
  builder.json["animations"][0]["samplers"][0]["output"] = builder.add_floats(values, "VEC3");
  EXPECT_EQ(animated_message(builder),
            "a.gltf animations[0].samplers[0].output: element 4: expected finite numbers, got not "
            "finite");
}

TEST(GltfAnimationErrors, the_sum_of_all_keys_is_bounded) {
  GltfBuilder builder = dancer();
  // Zeros without a buffer view cost a file nothing.
  builder.json["accessors"].push_back(
      Json{{"componentType", 5126}, {"count", 500'000'000}, {"type", "SCALAR"}});
  builder.json["animations"][0]["samplers"][0]["input"] = builder.json["accessors"].size() - 1;
  EXPECT_EQ(animated_message(builder),
            "a.gltf animations[0].samplers[0].input: numbers of all animations: expected at most "
            "268435456, got 500000000");
}

TEST(GltfAnimationErrors, morph_weights_of_all_nodes_are_bounded) {
  GltfBuilder builder = triangle();
  builder.primitive()["targets"] = Json(1 << 11, Json::object());
  builder.json["nodes"] = Json((1 << 11) + 1, Json{{"mesh", 0}});
  for (const char* key : {"scene", "scenes"}) builder.json.erase(key);
  EXPECT_EQ(outcome(builder.load()), "ok");
  EXPECT_EQ(animated_message(builder),
            "a.gltf nodes[2048]: morph weights of all nodes: expected at most 4194304, got "
            "4196352");
}

TEST(GltfAnimationErrors, cycles_and_joints_that_are_not_there_are_refused) {
  GltfBuilder builder = dancer();
  builder.json["nodes"][3]["children"] = {2};
  EXPECT_EQ(
      animated_message(builder),
      "a.gltf nodes[2]: the node has two parents: expected a tree, got nodes[0] and nodes[3]");
  builder = dancer();
  builder.json["skins"][0]["joints"] = {2, 3};
  EXPECT_EQ(animated_message(builder).substr(0, 70),
            "a.gltf meshes[0].primitives[0].JOINTS: joint out of range: expected 0 ");
}

}  // namespace
}  // namespace voxeld
