// Writes Wavefront's .obj: "v x y z" in world units, with " r g b" (sRGB, 0 to 1) where the grid
// has colours, an extension that MeshLab, Blender and others read; "vn" of a smooth mesh; then "f"
// with 3 or 4 vertices. Numbers are the shortest that read back as the same float, or double where
// floats are too coarse. Comments hold dims, origin, voxel_size, units and transform.
#include <array>
#include <charconv>
#include <string>
#include <vector>

#include "server/base/cancel_point.h"
#include "server/formats/formats.h"
#include "server/formats/mesh/mesh_rows.h"
#include "server/formats/mesh/surface_mesh.h"
#include "server/formats/mesh/world_vertices.h"
#include "server/formats/output_file.h"

namespace voxeld::mesh {
namespace {

using Text = std::vector<uint8_t>;

template <typename Number>
void append_number(Text& text, Number value) {
  std::array<char, 32> digits{};  // the longest double has 24 characters
  const auto written = std::to_chars(digits.data(), digits.data() + digits.size(), value);
  text.insert(text.end(), digits.data(), written.ptr);
}

// A byte as a part of 1, to four places: from 0 to 1.
using ByteTexts = std::array<std::string, 256>;
const ByteTexts& byte_texts() {
  static const ByteTexts texts = [] {
    ByteTexts made;
    for (int i = 0; i < 256; ++i) {
      const std::string places = std::to_string(10000 + (i * 10000 + 127) / 255);
      made[static_cast<size_t>(i)] = i == 255 ? " 1" : " 0." + places.substr(1);
    }
    return made;
  }();
  return texts;
}

// Appends rows of text, which are made on all threads and written in order.
template <typename Row>
Status append_rows(OutputFile& file, size_t rows, Row&& row) {
  const size_t at_once = 4 * ThreadPool::shared().threads();  // pieces in memory
  std::vector<Text> texts(std::min(at_once, piece_count_of(rows)));
  for (size_t first = 0; first < rows; first += texts.size() * kPieceRows) {
    cancel_point();
    const size_t count = std::min(rows - first, texts.size() * kPieceRows);
    for_each_piece(count, [&](size_t piece, size_t begin, size_t end) {
      texts[piece].clear();
      for (size_t i = begin; i < end; ++i) row(first + i, texts[piece]);
    });
    for (size_t i = 0; i < piece_count_of(count); ++i) VOXELD_TRY(file.append(texts[i]));
  }
  return {};
}

Status append_vertices(OutputFile& file, const GridSpec& spec, const SurfaceMesh& mesh) {
  const bool is_float = fits_float(spec);
  return append_rows(file, mesh.vertices.size(), [&](size_t i, Text& text) {
    const glm::dvec3 p = world_position(spec, mesh.vertices[i]);
    text.push_back('v');
    for (int axis = 0; axis < 3; ++axis) {
      text.push_back(' ');
      is_float ? append_number(text, static_cast<float>(p[axis])) : append_number(text, p[axis]);
    }
    for (unsigned c = 0; mesh.has_colors && c < 3; ++c) {
      const std::string& part = byte_texts()[byte_of(mesh.vertices[i].color, c)];
      text.insert(text.end(), part.begin(), part.end());
    }
    text.push_back('\n');
  });
}

Status append_normals(OutputFile& file, const GridSpec& spec, const SurfaceMesh& mesh) {
  return append_rows(file, mesh.normals.size(), [&](size_t i, Text& text) {
    text.insert(text.end(), {'v', 'n'});
    for (const float component : world_normal(spec, mesh.normals[i])) {
      text.push_back(' ');
      append_number(text, component);
    }
    text.push_back('\n');
  });
}

Status append_faces(OutputFile& file, const SurfaceMesh& mesh) {
  const bool has_normals = mesh.normals.size() > 0;
  return append_rows(file, mesh.faces.size(), [&](size_t i, Text& text) {
    text.push_back('f');
    for (const uint32_t corner : mesh.faces[i].corners) {
      if (corner == kNoVertex) break;
      text.push_back(' ');
      append_number(text, corner + 1);
      if (!has_normals) continue;
      text.insert(text.end(), {'/', '/'});
      append_number(text, corner + 1);
    }
    text.push_back('\n');
  });
}

}  // namespace
}  // namespace voxeld::mesh

namespace voxeld {

Status encode_obj(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  using namespace mesh;
  VOXELD_ASSIGN(const SurfaceMesh mesh, make_surface_mesh(grid, options));
  std::string header = "# voxeld\n";
  for (const std::string& line : placement_lines(grid)) header += "# " + line + "\n";
  header += "o voxels\n";
  VOXELD_TRY(file.append({reinterpret_cast<const uint8_t*>(header.data()), header.size()}));
  VOXELD_TRY(append_vertices(file, grid.spec, mesh));
  VOXELD_TRY(append_normals(file, grid.spec, mesh));
  return append_faces(file, mesh);
}

}  // namespace voxeld
