// Writes Stanford's .ply, binary little-endian:
//
//   header            text; comments hold dims, origin, voxel_size, units and transform
//   each vertex       x y z in world units, float, or double where floats are too coarse
//                     nx ny nz, float, of a smooth mesh
//                     red green blue alpha, uchar, sRGB, of a grid with colours
//   each face         uchar 3 or 4, then so many int indices
#include <array>
#include <cstring>
#include <string>

#include "server/formats/formats.h"
#include "server/formats/mesh/mesh_rows.h"
#include "server/formats/mesh/surface_mesh.h"
#include "server/formats/mesh/world_vertices.h"
#include "server/formats/output_file.h"

namespace voxeld::mesh {
namespace {

constexpr size_t kTriangleBytes = 1 + 3 * sizeof(uint32_t);
constexpr size_t kQuadBytes = 1 + 4 * sizeof(uint32_t);

std::string header_of(const Grid& grid, const SurfaceMesh& mesh, bool is_float) {
  std::string text = "ply\nformat binary_little_endian 1.0\ncomment voxeld\n";
  for (const std::string& line : placement_lines(grid)) text += "comment " + line + "\n";
  text += "element vertex " + std::to_string(mesh.vertices.size()) + "\n";
  const std::string type = is_float ? "float" : "double";
  for (const char* name : {"x", "y", "z"}) text += "property " + type + " " + name + "\n";
  if (mesh.normals.size() > 0) {
    for (const char* name : {"nx", "ny", "nz"})
      text += std::string("property float ") + name + "\n";
  }
  if (mesh.has_colors) {
    for (const char* name : {"red", "green", "blue", "alpha"}) {
      text += std::string("property uchar ") + name + "\n";
    }
  }
  text += "element face " + std::to_string(mesh.faces.size()) + "\n";
  text += "property list uchar int vertex_indices\nend_header\n";
  return text;
}

template <typename T>
uint8_t* put_row(uint8_t* out, const T& row) {
  std::memcpy(out, &row, sizeof row);
  return out + sizeof row;
}

MeshRows vertex_rows(const GridSpec& spec, const SurfaceMesh& mesh, bool is_float) {
  const bool has_normals = mesh.normals.size() > 0;
  const size_t row_bytes = 3 * (is_float ? sizeof(float) : sizeof(double)) +
                           (has_normals ? 3 * sizeof(float) : 0) +
                           (mesh.has_colors ? sizeof(Rgba) : 0);
  return {mesh.vertices.size(), row_bytes,
          [&spec, &mesh, is_float, has_normals](size_t begin, size_t end, uint8_t* out) {
            for (size_t i = begin; i < end; ++i) {
              const glm::dvec3 p = world_position(spec, mesh.vertices[i]);
              if (is_float) {
                out = put_row(out,
                              std::array<float, 3>{static_cast<float>(p.x), static_cast<float>(p.y),
                                                   static_cast<float>(p.z)});
              } else {
                out = put_row(out, std::array<double, 3>{p.x, p.y, p.z});
              }
              if (has_normals) out = put_row(out, world_normal(spec, mesh.normals[i]));
              if (mesh.has_colors) out = put_row(out, mesh.vertices[i].color);
            }
          }};
}

MeshRows face_rows(const SurfaceMesh& mesh) {
  const auto fill = [&mesh](size_t begin, size_t end, uint8_t* out) {
    for (size_t i = begin; i < end; ++i) {
      const Face& face = mesh.faces[i];
      const uint8_t corners = face.is_quad() ? 4 : 3;
      *out++ = corners;
      std::memcpy(out, face.corners.data(), corners * sizeof(uint32_t));
      out += corners * sizeof(uint32_t);
    }
  };
  return {mesh.faces.size(), fill, [&mesh](size_t begin, size_t end) {
            const uint64_t quads = quads_among(mesh.faces.span().subspan(begin, end - begin));
            return quads * kQuadBytes + (end - begin - quads) * kTriangleBytes;
          }};
}

}  // namespace
}  // namespace voxeld::mesh

namespace voxeld {

Status encode_ply(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  using namespace mesh;
  VOXELD_ASSIGN(const SurfaceMesh mesh, make_surface_mesh(grid, options));
  const bool is_float = fits_float(grid.spec);
  const std::string header = header_of(grid, mesh, is_float);
  VOXELD_TRY(file.append({reinterpret_cast<const uint8_t*>(header.data()), header.size()}));
  VOXELD_TRY(append_pieces(file, vertex_rows(grid.spec, mesh, is_float)));
  return append_pieces(file, face_rows(mesh));
}

}  // namespace voxeld
