#include "tests/unit/scene_animation/animation_fixtures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <glm/geometric.hpp>

#include "server/scene/load.h"
#include "tests/unit/scene/zip_maker.h"

namespace voxeld {
namespace {

struct Worst {
  double position = 0, normal = 0;
  void add(const glm::dvec3& got, const reference::Vec3& expected, double& to) {
    to = std::max(to, glm::distance(got, glm::dvec3(expected[0], expected[1], expected[2])));
  }
  void expect_small() const {
    EXPECT_LT(position, kFrameTolerance);
    EXPECT_LT(normal, kFrameTolerance);
  }
};

Bytes i16_bytes(const std::vector<int16_t>& values) {
  Bytes bytes(values.size() * 2);
  std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

int normalized(GltfBuilder& builder, int accessor) {
  builder.json["accessors"][static_cast<size_t>(accessor)]["normalized"] = true;
  return accessor;
}

// A ribbon of six vertices along y that follows nodes 2, 3 and 4.
void add_ribbon(GltfBuilder& b) {
  Json attributes;
  attributes["POSITION"] =
      b.add_floats({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0.5f, 1, 2, 0.5f}, "VEC3");
  attributes["NORMAL"] =
      b.add_floats({0, 0, 1, 0, 0, 1, 0, 0.6f, 0.8f, 0, 0.6f, 0.8f, 0, 0, 2, 0, 1, 1}, "VEC3");
  attributes["JOINTS_0"] = b.add_accessor(
      {0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 2, 0, 2, 1, 0, 0, 2, 0, 0, 0}, 5121, "VEC4", 6);
  attributes["WEIGHTS_0"] =
      normalized(b, b.add_accessor({255, 0,  0,  0, 255, 0,  0, 0, 127, 127, 0, 0,
                                    100, 50, 50, 0, 200, 20, 0, 0, 255, 0,   0, 0},
                                   5121, "VEC4", 6));
  attributes["JOINTS_1"] =
      b.add_u16({0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC4");
  attributes["WEIGHTS_1"] = b.add_floats(
      {0, 0, 0, 0, 0, 0, 0, 0, 0.25f, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC4");
  Json primitive;
  primitive["attributes"] = attributes;
  primitive["indices"] = b.add_u16({0, 1, 2, 2, 1, 3, 2, 3, 4, 4, 3, 5});
  b.json["meshes"][0]["primitives"][0] = primitive;
  // Each joint's own place, undone.
  const int inverse = b.add_floats(
      {1, 0, 0, 0, 0,     1,  0, 0, 0, 0, 1,  0, -0.5f, 0, 0, 1, 1, 0, 0, 0, 0, 1,  0, 0,
       0, 0, 1, 0, -0.5f, -1, 0, 1, 0, 0, -1, 0, 0,     1, 0, 0, 1, 0, 0, 0, 0, -2, 0, 1},
      "MAT4");
  b.json["skins"] = Json::array({Json{{"joints", {2, 3, 4}}, {"inverseBindMatrices", inverse}}});
}

// A triangle with a dense target (positions and normals) and a sparse one (positions).
void add_face(GltfBuilder& b) {
  Json primitive;
  primitive["attributes"]["POSITION"] = b.add_floats({0, 0, 0, 2, 0, 0, 0, 2, 0}, "VEC3");
  primitive["attributes"]["NORMAL"] = b.add_floats({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  const int smile = b.add_floats({0, 0, 1, 0, 0.5f, 0, 0, 0, 0}, "VEC3");
  const int lean = b.add_floats({0.5f, 0, 0, 0, 0.25f, 0, 0, 0, 0}, "VEC3");
  const int sparse = b.add_floats({0, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC3");
  const int values = b.add_floats({-1, 2, 3}, "VEC3");
  b.json["accessors"][static_cast<size_t>(sparse)]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", b.add_view({2})}, {"componentType", 5121}}},
      {"values", {{"bufferView", b.json["accessors"][static_cast<size_t>(values)]["bufferView"]}}}};
  primitive["targets"] =
      Json::array({Json{{"POSITION", smile}, {"NORMAL", lean}}, Json{{"POSITION", sparse}}});
  b.json["meshes"].push_back(Json{{"primitives", {primitive}}, {"weights", {0.0, 0.125}}});
}

void add_hat(GltfBuilder& b) {
  Json primitive;
  primitive["attributes"]["POSITION"] = b.add_floats({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
  b.json["meshes"].push_back(Json{{"primitives", {primitive}}});
}

Json channel(int sampler, int node, const char* path) {
  return Json{{"sampler", sampler}, {"target", {{"node", node}, {"path", path}}}};
}

Json sampler(int input, int output, const char* interpolation) {
  Json out = {{"input", input}, {"output", output}};
  if (interpolation != nullptr) out["interpolation"] = interpolation;
  return out;
}

Json spline_animation(GltfBuilder& b) {
  const int times = b.add_floats({0.25f, 1, 2}, "SCALAR");
  const int move = b.add_floats(
      {0, 0, 0, 0, 0, 0, 1, 2, 3, 0, 1, 0, 3, 1, 0, 0, -1, 2, 1, 1, 1, -2, 0, 5, 0, 0, 0}, "VEC3");
  const int turn = b.add_floats(
      {0, 0,    0, 0, 0,    0,     0, 1, 0.2f, 0, 0.1f, 0,    0.3f, 0,    0, 0, 0, 0.6f,
       0, 0.8f, 0, 0, 0.5f, -0.2f, 0, 0, 0,    0, 0.5f, 0.5f, 0.5f, 0.5f, 0, 0, 0, 0},
      "VEC4");
  const int weights =
      b.add_floats({0, 0, 0.5f, 0, 1, 0, 0, 1, 1, 0.25f, 0, 0, -1, 0, 0, 1, 0, 0}, "SCALAR");
  return Json{
      {"name", "spline"},
      {"samplers",
       {sampler(times, move, "CUBICSPLINE"), sampler(times, turn, "CUBICSPLINE"),
        sampler(times, weights, "CUBICSPLINE")}},
      {"channels",
       {channel(0, 2, "translation"), channel(1, 3, "rotation"), channel(2, 5, "weights")}}};
}

Json plain_animation(GltfBuilder& b) {
  const int times = b.add_floats({0, 0.5f, 0.75f}, "SCALAR");
  const int two = b.add_floats({0.1f, 1}, "SCALAR");
  // 0.8 is 26214 of 32767; the third is the negative of a near rotation.
  const int turn = normalized(
      b, b.add_accessor(i16_bytes({0, 0, 0, 32767, 0, 19661, 0, 26214, 0, -20000, 3000, -26000}),
                        5122, "VEC4", 3));
  const int move = b.add_floats({0, 0, 0, 4, 2, -8}, "VEC3");
  const int scale = b.add_floats({1, 1, 1, 2, 0.5f, 1}, "VEC3");
  const int weights = b.add_floats({0, 1, 0.5f, 0.5f, 1, 0}, "SCALAR");
  return Json{{"samplers",
               {sampler(times, turn, nullptr), sampler(two, move, "LINEAR"),
                sampler(two, scale, "STEP"), sampler(times, weights, "LINEAR")}},
              {"channels",
               {channel(0, 3, "rotation"), channel(1, 2, "translation"), channel(2, 5, "scale"),
                channel(3, 5, "weights"), channel(0, 5, "rotation")}}};
}

}  // namespace

std::string puppet_mesh() {
  return R"(MD5Version 10
commandline ""
numJoints 5
numMeshes 2
joints {
  "hip" -1 ( 0 0 10 ) ( 0.1 0.2 -0.3 )
  "arm" 0 ( 4 0 14 ) ( 0 0 0.70710678 )
  "hand" 1 ( 8 1 14 ) ( -0.5 -0.5 0.5 )
  "lamp" -1 ( 20 -5 3 ) ( 0 0.6 0 )
  "flame" 3 ( 20 -5 5 ) ( 0.3 0 0.4 )
}
mesh {
  shader "cloth"
  numverts 4
  vert 0 ( 0 0 ) 0 1
  vert 1 ( 1 0 ) 1 2
  vert 2 ( 0 1 ) 3 3
  vert 3 ( 1 1 ) 6 1
  numtris 2
  tri 0 0 1 2
  tri 1 2 1 3
  numweights 7
  weight 0 0 1 ( 1 0 -3 )
  weight 1 0 0.25 ( 4 4 0 )
  weight 2 1 0.75 ( 2 1 1 )
  weight 3 0 0.2 ( 1 7 2 )
  weight 4 1 0.3 ( -3 2 5 )
  weight 5 2 0.5 ( 1 1 1 )
  weight 6 2 1 ( 0.5 3 -0.5 )
}
mesh {
  shader "lamp"
  numverts 3
  vert 0 ( 0 0 ) 0 1
  vert 1 ( 1 0 ) 1 1
  vert 2 ( 0 1 ) 2 2
  numtris 1
  tri 0 0 2 1
  numweights 4
  weight 0 3 1 ( 1 0 0 )
  weight 1 4 1 ( 0 1 0 )
  weight 2 3 0.5 ( 0 0 2 )
  weight 3 4 0.5 ( 0 0 1 )
}
)";
}

std::string puppet_walk() {
  return R"(MD5Version 10
commandline ""
numFrames 4
numJoints 5
frameRate 10
numAnimatedComponents 11
hierarchy {
  "lamp" -1 0 0
  "hip" -1 21 0
  "flame" 0 8 3
  "arm" 1 56 4
  "hand" 3 50 8
}
bounds {
  ( 0 0 0 ) ( 1 1 1 )
  ( 0 0 0 ) ( 1 1 1 )
  ( 0 0 0 ) ( 1 1 1 )
  ( 0 0 0 ) ( 1 1 1 )
}
baseframe {
  ( 20 -5 3 ) ( 0 0.6 0 )
  ( 0 1 10 ) ( 0.1 0.2 -0.3 )
  ( 0 0 2 ) ( 0 0 0.4 )
  ( 4 0 4 ) ( 0 0 0 )
  ( 1 4 0 ) ( -0.5 0 0.5 )
}
frame 0 {
  0 10 0.1 0.1 0 0 0.7 0 4 0 0.5
}
frame 1 {
  3 10.5 0.1 0.2 0.1 0 0.6 0 4.5 0.1 0.4
}
frame 2 {
  6 11 0.0 0.3 0.2 0.1 0.5 0 5 0.2 0.3
}
frame 3 {
  9 10.5 -0.1 0.9 0.3 0.3 -0.9 0 4 -0.6 0.2
}
)";
}

std::string puppet_wave() {
  return R"(MD5Version 10
commandline ""
numFrames 2
numJoints 5
frameRate 24
numAnimatedComponents 6
hierarchy {
  "hip" -1 0 0
  "arm" 0 0 0
  "hand" 1 0 0
  "lamp" -1 63 0
  "flame" 3 0 0
}
baseframe {
  ( 0 0 10 ) ( 0.1 0.2 -0.3 )
  ( 4 0 4 ) ( 0 0 0.70710678 )
  ( 1 4 0 ) ( -0.5 -0.5 0.5 )
  ( 0 0 0 ) ( 0 0 0 )
  ( 0 0 2 ) ( 0.3 0 0.4 )
}
frame 0 {
  20 -5 3 0 0.6 0
}
frame 1 {
  -20 5 7 0.1 -0.2 0.3
}
)";
}

std::string puppet_zip() {
  return test::ZipMaker()
      .add("puppet.md5mesh", puppet_mesh())
      .add("anims/walk.md5anim", puppet_walk())
      .add("__MACOSX/anims/._walk.md5anim", "")
      .add("anims/wave.MD5ANIM", puppet_wave())
      .bytes();
}

GltfBuilder dancer() {
  GltfBuilder builder;
  add_ribbon(builder);
  add_face(builder);
  add_hat(builder);
  const double h = std::sqrt(0.5);
  builder.json["nodes"] = Json::array(
      {Json{{"name", "all"},
            {"children", {1, 2, 5}},
            {"translation", {10, 0, -3}},
            {"rotation", {h, 0, 0, h}}},
       Json{{"name", "ribbon"}, {"mesh", 0}, {"skin", 0}, {"translation", {99, 99, 99}}},
       Json{{"name", "hip"}, {"children", {3}}, {"translation", {0.5, 0, 0}}},
       Json{{"name", "knee"},
            {"children", {4}},
            {"translation", {0, 1, 0}},
            {"rotation", {0, 0, 0.6, 0.8}},
            {"scale", {1, 1.5, 1}}},
       Json{{"name", "toe"}, {"matrix", {0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1}}},
       Json{{"name", "face"},
            {"mesh", 1},
            {"children", {6}},
            {"scale", {1, 2, 3}},
            {"weights", {0.5, 0.25}}},
       Json{{"name", "hat"}, {"mesh", 2}, {"translation", {0, 0, 1}}}});
  const Json spline = spline_animation(builder);
  builder.json["animations"] = Json::array({spline, plain_animation(builder)});
  return builder;
}

AnimatedScene loaded(std::string_view filename, std::string_view bytes) {
  auto animated =
      load_animated_scene(filename, {reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()},
                          {.decode_images = false});
  EXPECT_TRUE(animated.ok()) << animated.error().message();
  return animated ? *std::move(animated) : AnimatedScene();
}

AnimatedScene loaded(const GltfBuilder& builder) {
  return loaded("a.gltf", builder.text());
}

FrameVertices frame_of(const AnimatedScene& animated, size_t animation, double seconds) {
  auto frame = scene_at(animated, animation, seconds);
  EXPECT_TRUE(frame.ok()) << frame.error().message();
  return frame ? *std::move(frame) : FrameVertices();
}

void expect_frame(const FrameVertices& frame, const std::vector<reference::OraclePart>& expected) {
  ASSERT_EQ(frame.parts.size(), expected.size());
  Worst worst;
  for (size_t p = 0; p < expected.size(); ++p) {
    ASSERT_EQ(frame.parts[p].positions.size(), expected[p].positions.size());
    ASSERT_EQ(frame.parts[p].normals.size(), expected[p].normals.size());
    for (size_t v = 0; v < expected[p].positions.size(); ++v) {
      worst.add(frame.parts[p].positions[v], expected[p].positions[v], worst.position);
      worst.add(glm::dvec3(frame.parts[p].normals[v]), expected[p].normals[v], worst.normal);
    }
  }
  worst.expect_small();
}

void expect_frame(const FrameVertices& frame, const Scene& scene,
                  const std::vector<reference::OracleCorners>& expected) {
  ASSERT_EQ(frame.parts.size(), expected.size());
  Worst worst;
  for (size_t p = 0; p < expected.size(); ++p) {
    const std::vector<uint32_t>& indices = scene.parts[p].indices;
    ASSERT_EQ(indices.size(), expected[p].positions.size());
    ASSERT_EQ(frame.parts[p].normals.empty(), expected[p].normals.empty());
    for (size_t i = 0; i < indices.size(); ++i) {
      worst.add(frame.parts[p].positions[indices[i]], expected[p].positions[i], worst.position);
      if (expected[p].normals.empty()) continue;
      worst.add(glm::dvec3(frame.parts[p].normals[indices[i]]), expected[p].normals[i],
                worst.normal);
    }
  }
  worst.expect_small();
}

}  // namespace voxeld
