// Writes Khronos' binary glTF 2.0 (.glb), a mesh with these arrays:
//
//   POSITION  x y z of each vertex: float, in cells of the grid
//   NORMAL    x y z, in cells, of a smooth mesh: float
//   COLOR_0   R G B A of each vertex of a grid with colours: u16, linear light
//   indices   u16 or u32, three for each triangle
//
// The node's translation and scale are the grid's origin and voxel size, so cells become world
// units and positions are exact integers at any place in the world. 16 bits of linear light tell
// all 256 values of sRGB apart. The scene's extras hold dims, origin, voxel_size and meta.
//
// Compressed files (compress=meshopt) have quantized arrays, padded to 4 bytes: positions are u16
// in cells, and normals i8 (KHR_mesh_quantization). Those of a smooth mesh are in a power of two of
// a cell, and begin half a cell before the grid; the node's translation and scale say so.
//
// Instances (mesh=instances, EXT_mesh_gpu_instancing) are a cube, and for each voxel TRANSLATION
// (float, in cells) and _COLOR_0 (float R G B, linear light; three.js and Babylon.js read it).
#include <array>
#include <cmath>
#include <cstring>
#include <mutex>
#include <string>

#include <nlohmann/json.hpp>

#include "server/formats/formats.h"
#include "server/formats/mesh/glb_file.h"
#include "server/formats/mesh/mesh_rows.h"
#include "server/formats/mesh/outer_voxels.h"
#include "server/formats/mesh/surface_mesh.h"
#include "server/formats/output_file.h"
#include "server/grid/color/color_tables.h"

namespace voxeld::mesh {
namespace {

using nlohmann::json;
using Use = GlbBuffer::Use;

constexpr int kTypeI8 = 5120, kTypeU16 = 5123, kTypeU32 = 5125, kTypeFloat = 5126;
constexpr double kU16Max = 65535;
// The largest number of vertices with indices of two bytes; index 65535 restarts primitives.
constexpr size_t kShortVerticesMax = 65535;

template <typename Row, typename RowOf>
MeshRows rows_of(size_t count, RowOf&& row_of_element) {
  return {count, sizeof(Row), [row_of_element](size_t begin, size_t end, uint8_t* out) {
            for (size_t i = begin; i < end; ++i, out += sizeof(Row)) {
              const Row row = row_of_element(i);
              std::memcpy(out, &row, sizeof row);
            }
          }};
}

json accessor_of(int component_type, size_t count, const char* type) {
  return {{"componentType", component_type}, {"count", count}, {"type", type}};
}

std::array<double, 3> linear_of(Rgba color) {
  std::array<double, 3> linear{};
  for (unsigned c = 0; c < 3; ++c) linear[c] = linear16_from_srgb8()[byte_of(color, c)] / kU16Max;
  return linear;
}

struct Box {
  std::array<float, 3> low, high;
  void add(const std::array<float, 3>& p) {
    for (size_t c = 0; c < 3; ++c) {
      low[c] = std::min(low[c], p[c]);
      high[c] = std::max(high[c], p[c]);
    }
  }
};

// Needs at least one vertex.
Box box_of(const UnsetArray<Vertex>& vertices) {
  Box box{vertices[0].p_grid, vertices[0].p_grid};
  std::mutex mutex;
  for_each_piece(vertices.size(), [&](size_t, size_t begin, size_t end) {
    Box own{vertices[begin].p_grid, vertices[begin].p_grid};
    for (size_t i = begin; i < end; ++i) own.add(vertices[i].p_grid);
    const std::lock_guard lock(mutex);
    box.add(own.low);
    box.add(own.high);
  });
  return box;
}

// A smooth mesh reaches so many cells beyond its grid at most.
constexpr double kSmoothReach = 0.5;

// Steps in a cell of a smooth mesh's quantized positions: as many as 16 bits hold.
int smooth_steps(const Grid& grid) {
  const int side = std::max({grid.spec.dims.x, grid.spec.dims.y, grid.spec.dims.z}) + 1;
  int steps = 1;
  while (2 * steps * side <= static_cast<int>(kU16Max)) steps *= 2;
  return steps;
}

class GlbMesh {
 public:
  GlbMesh(const Grid& grid, const OutputOptions& options)
      : grid_(grid),
        is_compressed_(options.compress == MeshCompression::kMeshopt),
        buffer_(is_compressed_) {
    const GridHeader header = container_header(grid);
    node_ = {{"name", "voxels"}, {"translation", header.origin}, {"scale", header.voxel_size}};
    json scene = {{"extras",
                   {{"dims", header.dims},
                    {"origin", header.origin},
                    {"voxel_size", header.voxel_size},
                    {"meta", grid.meta.members()}}}};
    document_ = {{"asset", {{"version", "2.0"}, {"generator", "voxeld"}}},
                 {"scene", 0},
                 {"scenes", json::array({std::move(scene)})}};
  }

  // The mesh outlives the writer and has faces.
  void add(const SurfaceMesh& mesh, bool is_cube) {
    // A cube's corners are no integers.
    json attributes;
    if (is_compressed_ && !is_cube) {
      attributes["POSITION"] = add_quantized_positions(mesh);
    } else {
      attributes["POSITION"] = add_positions(mesh.vertices, Use::kVertices, true);
    }
    if (mesh.normals.size() > 0) attributes["NORMAL"] = add_normals(mesh);
    if (mesh.has_colors) attributes["COLOR_0"] = add_colors(mesh);
    json primitive = {
        {"attributes", std::move(attributes)}, {"indices", add_indices(mesh)}, {"material", 0}};
    json primitives = json::array({std::move(primitive)});
    document_["meshes"] = json::array({{{"primitives", std::move(primitives)}}});
    document_["materials"] = json::array({material_of(mesh)});
    node_["mesh"] = 0;
  }

  void add_instances(const UnsetArray<Vertex>& cubes, bool has_colors) {
    json attributes = {{"TRANSLATION", add_positions(cubes, Use::kInstances, false)}};
    if (has_colors) {
      attributes["_COLOR_0"] = buffer_.add(
          rows_of<std::array<float, 3>>(cubes.size(),
                                        [&cubes](size_t i) {
                                          const auto [r, g, b] = linear_of(cubes[i].color);
                                          return std::array<float, 3>{static_cast<float>(r),
                                                                      static_cast<float>(g),
                                                                      static_cast<float>(b)};
                                        }),
          sizeof(std::array<float, 3>), Use::kInstances,
          accessor_of(kTypeFloat, cubes.size(), "VEC3"));
    }
    node_["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = std::move(attributes);
    require("EXT_mesh_gpu_instancing");
  }

  Status write(OutputFile& file) {
    if (node_.contains("mesh")) {
      buffer_.describe(document_);
      document_["scenes"][0]["nodes"] = json::array({0});
      document_["nodes"] = json::array({node_});
    }
    return buffer_.write(document_, file);
  }

 private:
  void require(const char* extension) {
    document_["extensionsUsed"].push_back(extension);
    document_["extensionsRequired"].push_back(extension);
  }

  int add_positions(const UnsetArray<Vertex>& vertices, Use use, bool has_box) {
    json accessor = accessor_of(kTypeFloat, vertices.size(), "VEC3");
    if (has_box) {
      const Box box = box_of(vertices);
      accessor["min"] = box.low;
      accessor["max"] = box.high;
    }
    return buffer_.add(rows_of<std::array<float, 3>>(
                           vertices.size(), [&vertices](size_t i) { return vertices[i].p_grid; }),
                       sizeof(std::array<float, 3>), use, std::move(accessor));
  }

  int add_quantized_positions(const SurfaceMesh& mesh) {
    const bool is_smooth = mesh.normals.size() > 0;
    const int steps = is_smooth ? smooth_steps(grid_) : 1;
    const double before = is_smooth ? kSmoothReach : 0;
    for (size_t c = 0; c < 3; ++c) {
      const double cell = node_["scale"][c].get<double>();
      node_["scale"][c] = cell / steps;
      node_["translation"][c] = node_["translation"][c].get<double>() - before * cell;
    }
    const auto quantize = [steps, before](const std::array<float, 3>& p) {
      std::array<uint16_t, 4> row{};  // the last one is padding
      for (size_t c = 0; c < 3; ++c) {
        const double place = (static_cast<double>(p[c]) + before) * steps;
        row[c] = static_cast<uint16_t>(std::clamp(std::round(place), 0.0, kU16Max));
      }
      return row;
    };
    const Box box = box_of(mesh.vertices);
    const auto corner = [&](const std::array<float, 3>& p) {
      const auto row = quantize(p);
      return json::array({row[0], row[1], row[2]});
    };
    json accessor = accessor_of(kTypeU16, mesh.vertices.size(), "VEC3");
    accessor["min"] = corner(box.low);
    accessor["max"] = corner(box.high);
    require("KHR_mesh_quantization");
    return buffer_.add(rows_of<std::array<uint16_t, 4>>(mesh.vertices.size(),
                                                        [&mesh, quantize](size_t i) {
                                                          return quantize(mesh.vertices[i].p_grid);
                                                        }),
                       sizeof(std::array<uint16_t, 4>), Use::kVertices, std::move(accessor));
  }

  int add_normals(const SurfaceMesh& mesh) {
    const size_t count = mesh.normals.size();
    if (!is_compressed_) {
      return buffer_.add(
          rows_of<std::array<float, 3>>(count, [&mesh](size_t i) { return mesh.normals[i]; }),
          sizeof(std::array<float, 3>), Use::kVertices, accessor_of(kTypeFloat, count, "VEC3"));
    }
    json accessor = accessor_of(kTypeI8, count, "VEC3");
    accessor["normalized"] = true;
    return buffer_.add(rows_of<std::array<int8_t, 4>>(
                           count,
                           [&mesh](size_t i) {
                             std::array<int8_t, 4> row{};
                             for (size_t c = 0; c < 3; ++c) {
                               row[c] = static_cast<int8_t>(std::lround(127 * mesh.normals[i][c]));
                             }
                             return row;
                           }),
                       sizeof(std::array<int8_t, 4>), Use::kVertices, std::move(accessor));
  }

  int add_colors(const SurfaceMesh& mesh) {
    json accessor = accessor_of(kTypeU16, mesh.vertices.size(), "VEC4");
    accessor["normalized"] = true;
    const auto color_of = [&mesh](size_t i) {
      const Rgba color = mesh.vertices[i].color;
      std::array<uint16_t, 4> row{};
      for (unsigned c = 0; c < 3; ++c) {
        row[c] = static_cast<uint16_t>(linear16_from_srgb8()[byte_of(color, c)]);
      }
      row[3] = static_cast<uint16_t>(257 * byte_of(color, 3));
      return row;
    };
    return buffer_.add(rows_of<std::array<uint16_t, 4>>(mesh.vertices.size(), color_of),
                       sizeof(std::array<uint16_t, 4>), Use::kVertices, std::move(accessor));
  }

  template <typename Index>
  static MeshRows index_rows(const SurfaceMesh& mesh) {
    const auto fill = [&mesh](size_t begin, size_t end, uint8_t* out) {
      for (size_t i = begin; i < end; ++i) {
        for_each_triangle(mesh.faces[i], [&](uint32_t a, uint32_t b, uint32_t c) {
          const std::array<Index, 3> corners = {static_cast<Index>(a), static_cast<Index>(b),
                                                static_cast<Index>(c)};
          std::memcpy(out, corners.data(), sizeof corners);
          out += sizeof corners;
        });
      }
    };
    return {mesh.faces.size(), fill, [&mesh](size_t begin, size_t end) {
              const uint64_t quads = quads_among(mesh.faces.span().subspan(begin, end - begin));
              return 3 * sizeof(Index) * (end - begin + quads);
            }};
  }

  int add_indices(const SurfaceMesh& mesh) {
    const bool is_short = mesh.vertices.size() <= kShortVerticesMax;
    MeshRows rows = is_short ? index_rows<uint16_t>(mesh) : index_rows<uint32_t>(mesh);
    const size_t bytes = is_short ? sizeof(uint16_t) : sizeof(uint32_t);
    const size_t count = rows.bytes() / bytes;
    return buffer_.add(std::move(rows), bytes, Use::kIndices,
                       accessor_of(is_short ? kTypeU16 : kTypeU32, count, "SCALAR"));
  }

  // The material of all faces. Its colour is the mesh's only one, or a factor of those of vertices.
  static json material_of(const SurfaceMesh& mesh) {
    json material = {{"name", "voxels"},
                     {"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 1}}}};
    if (!mesh.has_colors) {
      const auto [r, g, b] = linear_of(mesh.vertices[0].color);
      material["pbrMetallicRoughness"]["baseColorFactor"] = json::array({r, g, b, 1});
    } else if (std::ranges::any_of(mesh.vertices.span(), [](const Vertex& vertex) {
                 return byte_of(vertex.color, 3) != 255;
               })) {
      material["alphaMode"] = "BLEND";
    }
    return material;
  }

  const Grid& grid_;
  bool is_compressed_;
  GlbBuffer buffer_;
  json node_, document_;
};

// A cube of one cell around the origin.
SurfaceMesh cube_of(Rgba color) {
  SurfaceMesh cube;
  cube.vertices = UnsetArray<Vertex>(8);
  for (size_t i = 0; i < 8; ++i) {
    for (size_t c = 0; c < 3; ++c) cube.vertices[i].p_grid[c] = (i >> c & 1) != 0 ? 0.5F : -0.5F;
    cube.vertices[i].color = color;
  }
  constexpr std::array<std::array<uint32_t, 4>, 6> kSides = {
      {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}}};
  cube.faces = UnsetArray<Face>(kSides.size());
  for (size_t i = 0; i < kSides.size(); ++i) cube.faces[i] = {kSides[i]};
  return cube;
}

Status write_instances(const Grid& grid, GlbMesh& glb, OutputFile& file) {
  VOXELD_ASSIGN(const UnsetArray<Vertex> cubes, outer_voxels(grid, format_name(Format::kGlb)));
  const VoxelColors colors(grid);
  // Colours of instances are factors of the material's.
  const SurfaceMesh cube = cube_of(colors.several() ? rgba({255, 255, 255}) : colors.other());
  if (cubes.size() > 0) {
    glb.add(cube, true);
    glb.add_instances(cubes, colors.several());
  }
  return glb.write(file);
}

}  // namespace
}  // namespace voxeld::mesh

namespace voxeld {

Status encode_glb(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  using namespace mesh;
  GlbMesh glb(grid, options);
  if (options.mesh == MeshSurface::kInstances) return write_instances(grid, glb, file);
  VOXELD_ASSIGN(const SurfaceMesh mesh, make_surface_mesh(grid, options));
  if (mesh.faces.size() > 0) glb.add(mesh, false);  // accessors have at least one element
  return glb.write(file);
}

}  // namespace voxeld
