#include "server/formats/mesh/smooth_mesh.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/formats/bricks/voxel_bricks.h"
#include "server/formats/bricks/voxel_lookup.h"
#include "server/formats/mesh/mesh_rows.h"
#include "server/formats/mesh/rectangle_mesh.h"
#include "server/formats/mesh/rectangles.h"
#include "server/grid/color/color_tables.h"

namespace voxeld::mesh {
namespace {

// Positions and normals are summed in integers, so that the order of threads changes nothing.
using Integers = std::array<int32_t, 3>;

constexpr int kSteps = 1024;     // of positions in a voxel; 16384 voxels and 16 neighbours fit
constexpr int kRelaxations = 8;  // more change little that half a voxel allows
constexpr double kNormalSteps = 1 << 20;  // of a normal's component; sums of 2^11 faces fit
constexpr float kHalf = 0.5F;

std::string fill_of(const GridMeta& meta) {
  const auto options = meta.members().find("options");
  if (options == meta.members().end() || !options->is_object()) return "";
  const auto fill = options->find("fill");
  return fill != options->end() && fill->is_string() ? fill->get<std::string>() : "";
}

// The channel that decides which cells are inside. Bands and solids tell on which side a cell
// without a voxel is.
Inside inside_of(const Grid& grid) {
  const std::string fill = fill_of(grid.meta);
  if (grid.channels.distance && grid.meta.tells_sides()) return Inside::kNegativeInBand;
  if (grid.channels.distance && fill == "solid") return Inside::kNegative;
  if (grid.channels.coverage && fill == "solid") return Inside::kCovered;
  return Inside::kOccupied;
}

// The 2x2x2 cells around a lattice point, x lowest: bit c of the number is 1 for the upper cell.
using Cells = std::array<std::optional<VoxelLookup::Voxel>, 8>;

Cells cells_around(VoxelLookup& lookup, const Vertex& vertex) {
  Cells cells;
  for (size_t i = 0; i < cells.size(); ++i) {
    std::array<int, 3> cell{};
    for (size_t c = 0; c < 3; ++c) {
      cell[c] = static_cast<int>(vertex.p_grid[c]) - 1 + static_cast<int>(i >> c & 1);
    }
    cells[i] = lookup.at(cell);
  }
  return cells;
}

// Signed values of cells, negative inside, in units that fall by about 1 in a voxel along an axis.
class Field {
 public:
  Field(const Grid& grid, Inside inside) : inside_(inside) {
    if (!grid.meta.has_world_distances()) return;
    for (size_t axis = 0; axis < edges_.size(); ++axis) {
      edges_[axis] =
          static_cast<float>(grid.spec.voxel_size[static_cast<int>(axis)] / distance_unit(grid));
    }
  }

  // The value along an axis. nullopt: unknown.
  std::optional<float> at(const std::optional<VoxelLookup::Voxel>& voxel, size_t axis) const {
    if (!voxel) return std::nullopt;
    const bool is_full = voxel->attribute == kNoAttributes;
    if (inside_ == Inside::kCovered) {
      return kHalf - (is_full
                          ? 1.0F
                          : static_cast<float>(voxel->tile->coverage[voxel->attribute]) / 255.0F);
    }
    if (is_full) return -1.0F;
    return static_cast<float>(voxel->tile->distance[voxel->attribute]) / kDistanceSteps /
           edges_[axis];
  }
  // The value of an empty cell beside one inside with this value.
  std::optional<float> empty(float beside) const {
    if (inside_ == Inside::kNegativeInBand) return std::nullopt;
    return inside_ == Inside::kCovered ? kHalf : beside + 1;
  }

 private:
  Inside inside_;
  std::array<float, 3> edges_ = {1, 1, 1};  // of a voxel, in the unit of stored distances
};

// Moves a vertex from its lattice point to the mean of the crossings around it.
void move_to_crossings(const Field& field, const Cells& cells, Vertex& vertex) {
  std::array<float, 3> sum{};
  int crossings = 0;
  for (size_t i = 0; i < cells.size(); ++i) {
    for (size_t axis = 0; axis < 3; ++axis) {
      const auto inside = field.at(cells[i], axis);
      if (!inside || !(*inside < 0)) continue;
      const size_t other = i ^ (size_t{1} << axis);
      auto outside = field.at(cells[other], axis);
      if (!cells[other]) outside = field.empty(*inside);
      if (!outside || *outside < 0) continue;
      const float part = std::clamp(*inside / (*inside - *outside), 0.0F, 1.0F);
      for (size_t c = 0; c < 3; ++c) {
        const float at = (i >> c & 1) != 0 ? kHalf : -kHalf;
        sum[c] += c == axis ? at * (1 - 2 * part) : at;
      }
      ++crossings;
    }
  }
  if (crossings == 0) return;
  for (size_t c = 0; c < 3; ++c) vertex.p_grid[c] += sum[c] / static_cast<float>(crossings);
}

// The mean in linear light of the cells inside that have a colour of their own. Where none has
// one, as behind voxels of the surface that are mostly outside, that of all cells around.
Rgba mean_of(const VoxelColors& colors, const Field& field, Inside inside, const Cells& cells) {
  for (const bool is_inside : {true, false}) {
    std::array<uint32_t, 4> sum{};
    uint32_t count = 0;
    for (const auto& cell : cells) {
      if (!cell || !colors.has_own(*cell->tile, cell->attribute)) continue;
      const bool is_counted =
          !is_inside || inside == Inside::kOccupied || field.at(cell, 0).value_or(0) < 0;
      if (!is_counted) continue;
      const Rgba color = colors.of(*cell->tile, cell->attribute);
      for (unsigned c = 0; c < 3; ++c) sum[c] += linear16_from_srgb8()[byte_of(color, c)];
      sum[3] += byte_of(color, 3);
      ++count;
    }
    if (count == 0) continue;
    std::array<uint8_t, 3> mean{};
    for (size_t c = 0; c < 3; ++c) mean[c] = srgb8_from_linear16()[(sum[c] + count / 2) / count];
    return rgba(mean, static_cast<uint8_t>((sum[3] + count / 2) / count));
  }
  return colors.other();
}

void place_vertices(const VoxelBricks& voxels, const VoxelColors& colors, Inside inside,
                    SurfaceMesh& mesh) {
  const Field field(voxels.grid(), inside);
  for_each_piece(mesh.vertices.size(), [&](size_t, size_t begin, size_t end) {
    VoxelLookup lookup(voxels);
    for (size_t i = begin; i < end; ++i) {
      const Cells cells = cells_around(lookup, mesh.vertices[i]);
      if (colors.several()) mesh.vertices[i].color = mean_of(colors, field, inside, cells);
      if (inside != Inside::kOccupied) move_to_crossings(field, cells, mesh.vertices[i]);
    }
  });
}

void add_atomically(Integers& sum, const Integers& more) {
  for (size_t c = 0; c < 3; ++c) {
    std::atomic_ref(sum[c]).fetch_add(more[c], std::memory_order_relaxed);
  }
}

// Moves each vertex to the mean of its neighbours, at most half a voxel from where it began.
// All faces are quads. Each edge has two faces, which pass it in both directions, so each neighbour
// counts once.
void relax(SurfaceMesh& mesh) {
  const size_t count = mesh.vertices.size();
  std::vector<Integers> places, sums;
  std::vector<int32_t> neighbors;
  resize_in_pieces(places, count);
  resize_in_pieces(sums, count);
  resize_in_pieces(neighbors, count);
  for_each_piece(count, [&](size_t, size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      for (size_t c = 0; c < 3; ++c) {
        places[i][c] = static_cast<int32_t>(mesh.vertices[i].p_grid[c]) * kSteps;
      }
    }
  });
  for (int round = 0; round < kRelaxations; ++round) {
    for_each_piece(count, [&](size_t, size_t begin, size_t end) {
      std::fill(&sums[begin], &sums[begin] + (end - begin), Integers{});
    });
    for_each_piece(mesh.faces.size(), [&](size_t, size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const auto& corners = mesh.faces[i].corners;
        for (size_t k = 0; k < corners.size(); ++k) {
          add_atomically(sums[corners[k]], places[corners[(k + 1) % 4]]);
          if (round > 0) continue;
          std::atomic_ref(neighbors[corners[k]]).fetch_add(1, std::memory_order_relaxed);
        }
      }
    });
    for_each_piece(count, [&](size_t, size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        for (size_t c = 0; c < 3; ++c) {
          const int32_t from = static_cast<int32_t>(mesh.vertices[i].p_grid[c]) * kSteps;
          const int32_t mean = (2 * sums[i][c] + neighbors[i]) / (2 * neighbors[i]);
          places[i][c] = std::clamp(mean, from - kSteps / 2, from + kSteps / 2);
        }
      }
    });
  }
  for_each_piece(count, [&](size_t, size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      for (size_t c = 0; c < 3; ++c) {
        mesh.vertices[i].p_grid[c] = static_cast<float>(places[i][c]) / kSteps;
      }
    }
  });
}

// The normals of vertices: the sum of those of the faces around, by their area.
UnsetArray<std::array<float, 3>> normals_of(const SurfaceMesh& mesh) {
  std::vector<Integers> sums;
  resize_in_pieces(sums, mesh.vertices.size());
  for_each_piece(mesh.faces.size(), [&](size_t, size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const auto& corners = mesh.faces[i].corners;
      const auto p = [&](size_t k) -> const std::array<float, 3>& {
        return mesh.vertices[corners[k]].p_grid;
      };
      // Half the product of the diagonals is the area.
      Integers normal{};
      for (size_t c = 0; c < 3; ++c) {
        const size_t u = (c + 1) % 3, v = (c + 2) % 3;
        const double area = double{p(2)[u] - p(0)[u]} * (p(3)[v] - p(1)[v]) -
                            double{p(2)[v] - p(0)[v]} * (p(3)[u] - p(1)[u]);
        normal[c] = static_cast<int32_t>(std::lround(area / 2 * kNormalSteps));
      }
      for (const uint32_t corner : corners) add_atomically(sums[corner], normal);
    }
  });
  UnsetArray<std::array<float, 3>> normals(mesh.vertices.size());
  for_each_piece(normals.size(), [&](size_t, size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const auto [x, y, z] = sums[i];
      const double length = std::hypot(x, y, z);
      // Opposite faces may cancel where voxels touch at a corner.
      normals[i] = {0, 1, 0};
      if (length == 0) continue;
      normals[i] = {static_cast<float>(x / length), static_cast<float>(y / length),
                    static_cast<float>(z / length)};
    }
  });
  return normals;
}

}  // namespace

Result<SurfaceMesh> make_smooth_mesh(const Grid& grid, std::string_view format) {
  const Inside inside = inside_of(grid);
  const VoxelBricks voxels(grid, inside);
  const VoxelColors colors(grid);
  VOXELD_ASSIGN(const std::vector<RectangleSlab> slabs,
                find_rectangles(voxels, nullptr, false, format));
  VOXELD_ASSIGN(SurfaceMesh mesh, mesh_of_rectangles(voxels, slabs, false, format));
  mesh.has_colors = colors.several();
  for_each_piece(mesh.vertices.size(), [&](size_t, size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) mesh.vertices[i].color = colors.other();
  });
  if (mesh.has_colors || inside != Inside::kOccupied) place_vertices(voxels, colors, inside, mesh);
  if (inside == Inside::kOccupied) relax(mesh);
  mesh.normals = normals_of(mesh);
  return mesh;
}

}  // namespace voxeld::mesh
