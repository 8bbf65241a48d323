// Source::mesh: arrays as a binary PLY (Greg Turk, The PLY Polygon File Format, 1994:
// https://paulbourke.net/dataformats/ply/), as the Python package writes them:
//
//   header    text that ends with "end_header\n"
//   vertices  x y z as float or double; nx ny nz as float; red green blue [alpha] as bytes
//   triangles the byte 3 and three uint32
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <string>

#include "client/include/voxeld/client.h"
#include "proto/options/values.h"

namespace voxeld::client {
namespace {

static_assert(std::endian::native == std::endian::little);  // values are copied as they are

constexpr size_t kTriangleBytes = 1 + 3 * sizeof(std::uint32_t);

[[noreturn]] void bad_array(const std::string& what, const std::string& expected,
                            const std::string& got) {
  throw Error("file", 0, what, expected, got);
}

void append_text(std::vector<std::byte>& bytes, const std::string& text) {
  const auto piece = std::as_bytes(std::span(text));
  bytes.insert(bytes.end(), piece.begin(), piece.end());
}

// Copies values to `out` and returns the byte after them.
template <typename T>
std::byte* put(std::byte* out, std::span<const T> values) {
  return std::ranges::copy(std::as_bytes(values), out).out;
}

template <typename Real>
size_t vertex_count(std::span<const Real> vertices) {
  if (vertices.empty() || vertices.size() % 3 != 0) {
    bad_array("vertices", "x, y and z of each", std::to_string(vertices.size()) + " numbers");
  }
  return vertices.size() / 3;
}

template <typename Index>
void check_triangles(std::span<const Index> indices, size_t vertices) {
  if (indices.empty() || indices.size() % 3 != 0) {
    bad_array("triangles", "three vertices of each", std::to_string(indices.size()) + " indices");
  }
  for (size_t i = 0; i < indices.size(); ++i) {
    if (indices[i] >= 0 && static_cast<size_t>(indices[i]) < vertices) continue;
    bad_array("triangle " + std::to_string(i / 3), "vertices 0 to " + std::to_string(vertices - 1),
              std::to_string(indices[i]));
  }
}

// The components of each colour: 0, 3 or 4.
template <typename Shade>
size_t color_components(std::span<const Shade> colors, size_t vertices) {
  if (colors.empty()) return 0;
  if (colors.size() == 3 * vertices) return 3;
  if (colors.size() == 4 * vertices) return 4;
  bad_array("colors", "3 or 4 values for each of " + std::to_string(vertices) + " vertices",
            std::to_string(colors.size()) + " values");
}

std::vector<std::uint8_t> color_bytes(std::span<const std::uint8_t> colors, size_t) {
  return {colors.begin(), colors.end()};
}

std::vector<std::uint8_t> color_bytes(std::span<const float> colors, size_t components) {
  if (components == 0) return {};  // there are none
  std::vector<std::uint8_t> bytes;
  bytes.reserve(colors.size());
  for (const float value : colors) {
    if (!(value >= 0 && value <= 1)) {
      bad_array("colors, vertex " + std::to_string(bytes.size() / components), "values 0 to 1",
                option_values::to_text(double{value}));
    }
    bytes.push_back(static_cast<std::uint8_t>(std::lround(255 * value)));
  }
  return bytes;
}

struct PlyVertices {
  size_t count = 0;
  bool has_normals = false;
  size_t color_components = 0;
};

std::string ply_header(const PlyVertices& vertices, bool is_double, size_t triangles) {
  const std::string number = is_double ? "double" : "float";
  std::string text = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                     std::to_string(vertices.count) + "\n";
  for (const char* axis : {"x", "y", "z"}) text += "property " + number + " " + axis + "\n";
  if (vertices.has_normals) {
    for (const char* axis : {"x", "y", "z"}) text += std::string("property float n") + axis + "\n";
  }
  constexpr std::array kColors = {"red", "green", "blue", "alpha"};
  for (size_t c = 0; c < vertices.color_components; ++c) {
    text += "property uchar " + std::string(kColors[c]) + "\n";
  }
  return text + "element face " + std::to_string(triangles) +
         "\nproperty list uchar uint vertex_indices\nend_header\n";
}

template <typename Real, typename Index, typename Shade>
std::vector<std::byte> ply_bytes(std::span<const Real> positions, std::span<const Index> indices,
                                 std::span<const Shade> colors, std::span<const float> normals) {
  PlyVertices vertices{vertex_count(positions), !normals.empty(), 0};
  check_triangles(indices, vertices.count);
  vertices.color_components = color_components(colors, vertices.count);
  if (vertices.has_normals && normals.size() != 3 * vertices.count) {
    bad_array("normals", "x, y and z for each of " + std::to_string(vertices.count) + " vertices",
              std::to_string(normals.size()) + " numbers");
  }
  const std::vector<std::uint8_t> shades = color_bytes(colors, vertices.color_components);
  std::vector<std::byte> bytes;
  append_text(bytes, ply_header(vertices, sizeof(Real) == sizeof(double), indices.size() / 3));
  const size_t header_bytes = bytes.size();
  bytes.resize(header_bytes + positions.size_bytes() + normals.size_bytes() + shades.size() +
               indices.size() / 3 * kTriangleBytes);
  std::byte* out = bytes.data() + header_bytes;
  for (size_t v = 0; v < vertices.count; ++v) {
    out = put(out, positions.subspan(3 * v, 3));
    if (vertices.has_normals) out = put(out, normals.subspan(3 * v, 3));
    out = put(out, std::span<const std::uint8_t>(shades).subspan(v * vertices.color_components,
                                                                 vertices.color_components));
  }
  for (size_t i = 0; i < indices.size(); i += 3) {
    *out++ = std::byte{3};
    out = put(out, indices.subspan(i, 3));
  }
  return bytes;
}

}  // namespace

Source Source::mesh(const MeshVertices& vertices, const MeshIndices& triangles,
                    const MeshColors& colors, std::span<const float> normals) {
  return memory(
      std::visit([&](auto positions, auto indices,
                     auto shades) { return ply_bytes(positions, indices, shades, normals); },
                 vertices, triangles, colors),
      "mesh.ply");
}

}  // namespace voxeld::client
