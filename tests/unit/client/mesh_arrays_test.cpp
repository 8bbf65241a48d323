// Arrays as the PLY that is sent, read byte by byte.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "client/include/voxeld/client.h"
#include "tests/unit/client/client_test_tools.h"
#include "tests/unit/client/scripted_server.h"

namespace voxeld::client {
namespace {

using test::json_response;
using test::ScriptedServer;

const std::vector<float> kVertices = {0, 0, 0, 1, 0, 0, 0, 1.5, 0, 0, 0, 1};
const std::vector<std::uint32_t> kTriangles = {0, 1, 2, 3, 1, 0};

// The bytes that a source sends, and the name.
std::string sent(const Source& source) {
  EXPECT_EQ(source.filename(), "mesh.ply");
  ScriptedServer server({json_response(R"({"id":"sha256-a"})")});
  Client(server.url()).upload(source);
  return server.asked()[0].body;
}

std::string header_end(const std::string& ply) {
  return ply.substr(0, ply.find("end_header\n") + 11);
}

template <typename T>
T value_at(const std::string& bytes, size_t& offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  offset += sizeof value;
  return value;
}

TEST(MeshArrays, are_a_binary_ply) {
  const std::string ply = sent(Source::mesh(kVertices, kTriangles));
  const std::string header =
      "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
      "property float z\nelement face 2\nproperty list uchar uint vertex_indices\nend_header\n";
  ASSERT_EQ(header_end(ply), header);
  size_t at = header.size();
  for (const float value : kVertices) EXPECT_EQ(value_at<float>(ply, at), value);
  for (size_t i = 0; i < kTriangles.size(); ++i) {
    if (i % 3 == 0) {
      EXPECT_EQ(value_at<std::uint8_t>(ply, at), 3);
    }
    EXPECT_EQ(value_at<std::uint32_t>(ply, at), kTriangles[i]);
  }
  EXPECT_EQ(at, ply.size());
}

TEST(MeshArrays, doubles_normals_and_colors_follow_each_vertex) {
  const std::vector<double> vertices = {0.1, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::vector<std::int32_t> triangles = {0, 1, 2};
  const std::array<float, 9> normals = {0, 0, 1, 0, 1, 0, 1, 0, 0};
  const std::array<float, 12> colors = {0, 0.5, 1, 1, 0.25, 0, 0, 0, 1, 1, 1, 1};
  const std::string ply = sent(Source::mesh(vertices, triangles, colors, normals));
  const std::string header =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty double x\n"
      "property double y\nproperty double z\nproperty float nx\nproperty float ny\n"
      "property float nz\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "property uchar alpha\nelement face 1\nproperty list uchar uint vertex_indices\nend_header\n";
  ASSERT_EQ(header_end(ply), header);
  const std::array<std::uint8_t, 12> bytes = {0, 128, 255, 255, 64, 0, 0, 0, 255, 255, 255, 255};
  size_t at = header.size();
  for (size_t v = 0; v < 3; ++v) {
    for (size_t c = 0; c < 3; ++c) EXPECT_EQ(value_at<double>(ply, at), vertices[3 * v + c]);
    for (size_t c = 0; c < 3; ++c) EXPECT_EQ(value_at<float>(ply, at), normals[3 * v + c]);
    for (size_t c = 0; c < 4; ++c) EXPECT_EQ(value_at<std::uint8_t>(ply, at), bytes[4 * v + c]);
  }
  EXPECT_EQ(ply.size(), at + 13);
}

TEST(MeshArrays, colors_of_three_bytes_have_no_alpha) {
  const std::vector<std::uint8_t> colors = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};
  const std::string ply = sent(Source::mesh(kVertices, kTriangles, colors));
  EXPECT_EQ(ply.find("alpha"), std::string::npos);
  size_t at = header_end(ply).size() + 3 * sizeof(float);
  for (const int value : {1, 2, 3}) EXPECT_EQ(value_at<std::uint8_t>(ply, at), value);
}

TEST(MeshArrays, errors_say_what_was_expected) {
  const auto text_of_error = [](const MeshVertices& vertices, const MeshIndices& triangles,
                                const MeshColors& colors = {},
                                std::span<const float> normals = {}) {
    const Error error = error_of([&] { Source::mesh(vertices, triangles, colors, normals); });
    EXPECT_EQ(error.code(), "file");
    return std::string(error.what());
  };
  EXPECT_EQ(text_of_error(std::vector<float>(), kTriangles),
            "vertices: expected x, y and z of each, got 0 numbers");
  EXPECT_EQ(text_of_error(std::vector<double>(10), kTriangles),
            "vertices: expected x, y and z of each, got 10 numbers");
  EXPECT_EQ(text_of_error(kVertices, std::vector<std::uint32_t>(7)),
            "triangles: expected three vertices of each, got 7 indices");
  EXPECT_EQ(text_of_error(kVertices, std::vector<std::uint32_t>{0, 1, 2, 0, 4, 1}),
            "triangle 1: expected vertices 0 to 3, got 4");
  EXPECT_EQ(text_of_error(kVertices, std::vector<std::int32_t>{0, -1, 2}),
            "triangle 0: expected vertices 0 to 3, got -1");
  EXPECT_EQ(text_of_error(kVertices, kTriangles, std::vector<std::uint8_t>(15)),
            "colors: expected 3 or 4 values for each of 4 vertices, got 15 values");
  std::vector<float> colors(12);
  colors[7] = 1.5;
  EXPECT_EQ(text_of_error(kVertices, kTriangles, colors),
            "colors, vertex 2: expected values 0 to 1, got 1.5");
  colors[7] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(text_of_error(kVertices, kTriangles, colors),
            "colors, vertex 2: expected values 0 to 1, got nan");
  EXPECT_EQ(text_of_error(kVertices, kTriangles, {}, std::vector<float>(9)),
            "normals: expected x, y and z for each of 4 vertices, got 9 numbers");
}

}  // namespace
}  // namespace voxeld::client
