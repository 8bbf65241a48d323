// The skinning oracles themselves, checked against cases that a person can work out.
#include <gtest/gtest.h>

#include <cstring>
#include <nlohmann/json.hpp>

#include "tests/reference/gltf_skinning_oracle.h"
#include "tests/reference/md5_skinning_oracle.h"

namespace voxeld::reference {
namespace {

void expect_near(const Vec3& got, const Vec3& expected) {
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(got[i], expected[i], 1e-6) << "component " << i;
}

TEST(RigidMath, a_third_of_a_right_angle_is_thirty_degrees) {
  const double h = std::sqrt(0.5);
  const Mat3 none = rotation_of(0, 0, 0, 1), right = rotation_of(0, 0, -h, -h);
  expect_near(mapped(right, {1, 0, 0}), {0, 1, 0});
  expect_near(mapped(between(none, right, 1 / 3.0), {1, 0, 0}), {std::sqrt(0.75), 0.5, 0});
  expect_near(mapped(between(right, right, 0.5), {1, 0, 0}), {0, 1, 0});
}

TEST(RigidMath, normals_of_stretched_surfaces_stay_upright) {
  const Mat3 stretch = {{{2, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  const Vec3 along = mapped(stretch, {1, -1, 0});
  EXPECT_NEAR(dot(along, mapped(inverse_transposed(stretch), {1, 1, 0})), 0, 1e-12);
}

// A joint that swings about z by a quarter turn in two frames, seen with y up.
TEST(Md5SkinningOracle, a_swinging_joint_takes_its_vertices_along) {
  const OracleMd5Mesh mesh = read_md5_mesh(
      "MD5Version 10 joints { \"a\" -1 ( 0 0 5 ) ( 0 0 0 ) } // end\n"
      "mesh { shader \"s\" numverts 3 vert 0 ( 0 0 ) 0 1 vert 1 ( 0 0 ) 1 1 vert 2 ( 0 0 ) 2 1 "
      "numtris 1 tri 0 0 1 2 numweights 3 weight 0 0 1 ( 1 0 0 ) weight 1 0 1 ( 0 0 1 ) "
      "weight 2 0 1 ( 0 0 0 ) }");
  const OracleMd5Anim anim = read_md5_anim(
      "MD5Version 10 frameRate 2 hierarchy { \"a\" -1 33 0 } baseframe { ( 0 0 5 ) ( 0 0 0 ) } "
      "frame 0 { 0 0 } frame 1 { 8 -0.70710678 }");
  const OraclePart bind = md5_frame(mesh, nullptr, 0)[0];
  expect_near(bind.positions[0], {1, 5, 0});
  expect_near(bind.normals[0], {0, 0, -1});  // clockwise as seen from there
  // z = -sqrt(1/2) with w = -sqrt(1/2) turns x to y, which is -z with y up.
  const OraclePart last = md5_frame(mesh, &anim, 0.5)[0];
  expect_near(last.positions[0], {8, 5, -1});
  expect_near(last.positions[1], {8, 6, 0});
  expect_near(last.normals[0], {-1, 0, 0});
  const OraclePart half = md5_frame(mesh, &anim, 0.25)[0];
  expect_near(half.positions[0], {4 + std::sqrt(0.5), 5, -std::sqrt(0.5)});
}

// A triangle on a node that a spline moves, below one that turns.
TEST(GltfSkinningOracle, nodes_move_their_meshes) {
  const std::vector<float> numbers = {1, 0, 0, 0, 1, 0, 0, 0, 1,  // positions
                                      0, 2,                       // times
                                      9, 9, 9, 0, 0, 0, 3, 0, 0,  // in, value, out
                                      3, 0, 0, 8, 0, 0, 9, 9, 9};
  std::vector<uint8_t> buffer(numbers.size() * 4);
  std::memcpy(buffer.data(), numbers.data(), buffer.size());
  const nlohmann::json document = nlohmann::json::parse(R"({
    "bufferViews": [{"buffer": 0}],
    "accessors": [
      {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
      {"bufferView": 0, "componentType": 5126, "count": 2, "type": "SCALAR", "byteOffset": 36},
      {"bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3", "byteOffset": 44}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "nodes": [{"children": [1], "rotation": [0, 0, 1, 0]}, {"mesh": 0, "scale": [2, 1, 1]}],
    "scenes": [{"nodes": [0]}],
    "animations": [{"samplers": [{"input": 1, "output": 2, "interpolation": "CUBICSPLINE"}],
      "channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}]}]})");
  expect_near(gltf_frame(document, {buffer}, -1, 0).at(0).positions.at(0), {-2, 0, 0});
  expect_near(gltf_frame(document, {buffer}, 0, 9).at(0).positions.at(0), {-10, 0, 0});
  // Half way: (p0 + p1) / 2 + length / 8 * (t0 - t1) = 4 + 2 / 8 * (3 - 3).
  expect_near(gltf_frame(document, {buffer}, 0, 1).at(0).positions.at(0), {-6, 0, 0});
  // A quarter: 27/64 p0 + 27/64 a + 9/64 b + 1/64 p1 with a = 2, b = 6.
  expect_near(gltf_frame(document, {buffer}, 0, 0.5).at(0).positions.at(1),
              {-(27 * 2 + 9 * 6 + 8) / 64.0, -1, 0});
}

}  // namespace
}  // namespace voxeld::reference
