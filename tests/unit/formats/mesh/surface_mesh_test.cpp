// Meshes of voxels, compared with the faces of a dense array of cells.
#include "server/formats/mesh/surface_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "server/formats/bricks/voxel_bricks.h"
#include "server/formats/mesh/outer_voxels.h"
#include "server/formats/mesh/rectangles.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

using mesh::Face;
using mesh::Rgba;
using mesh::SurfaceMesh;
using Point = std::array<int, 3>;

OutputOptions meshed(MeshSurface surface) {
  OutputOptions options = test::to(Format::kPly);
  options.mesh = surface;
  return options;
}

SurfaceMesh mesh_of(const Grid& grid, MeshSurface surface) {
  auto mesh = mesh::make_surface_mesh(grid, meshed(surface));
  EXPECT_TRUE(mesh) << mesh.error().message();
  return std::move(*mesh);
}

// A face of a cell: its lower corner, the axis of its normal and whether it points up.
struct CellFace {
  Point corner;
  int axis;
  bool up;
  auto operator<=>(const CellFace&) const = default;
};

// Each cell with its colour.
std::map<Point, Rgba> cells_of(const Grid& grid) {
  const mesh::VoxelColors colors(grid);
  std::map<Point, Rgba> cells;
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      cells[{x, y, z}] = colors.of(tile, voxel);
    });
  }
  return cells;
}

std::map<CellFace, Rgba> outer_faces(const Grid& grid) {
  const std::map<Point, Rgba> cells = cells_of(grid);
  std::map<CellFace, Rgba> faces;
  for (const auto& [cell, color] : cells) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const bool up : {false, true}) {
        Point next = cell, corner = cell;
        next[static_cast<size_t>(axis)] += up ? 1 : -1;
        corner[static_cast<size_t>(axis)] += up ? 1 : 0;
        if (!cells.contains(next)) faces[{corner, axis, up}] = color;
      }
    }
  }
  return faces;
}

Point point_of(const SurfaceMesh& mesh, uint32_t vertex) {
  Point p{};
  for (size_t c = 0; c < 3; ++c) {
    p[c] = static_cast<int>(mesh.vertices[vertex].p_grid[c]);
    EXPECT_EQ(static_cast<float>(p[c]), mesh.vertices[vertex].p_grid[c]);
  }
  return p;
}

using Triangle = std::array<uint32_t, 3>;

std::vector<Triangle> triangles_of(const SurfaceMesh& mesh) {
  std::vector<Triangle> triangles;
  for (const Face& face : mesh.faces.span()) {
    const auto& [a, b, c, d] = face.corners;
    triangles.push_back({a, b, c});
    if (face.is_quad()) triangles.push_back({a, c, d});
  }
  return triangles;
}

// Twice the area of the corners' projection along the axis, positive if they run counter-clockwise
// seen from its upper end.
int64_t doubled_area(const std::array<Point, 3>& p, size_t axis) {
  const size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
  return int64_t{p[1][u] - p[0][u]} * (p[2][v] - p[0][v]) -
         int64_t{p[2][u] - p[0][u]} * (p[1][v] - p[0][v]);
}

// Adds the area that a triangle has of each face of a cell, in 1/2^k, by cutting it at the lattice:
// exact, as all corners are integers.
struct Corner {
  double u, v;
};
double clipped_area(const std::array<Corner, 3>& triangle, double u0, double v0) {
  std::vector<Corner> polygon(triangle.begin(), triangle.end());
  const auto clip = [&](auto&& inside) {  // inside(corner): distance to the line, >= 0 is kept
    std::vector<Corner> kept;
    for (size_t i = 0; i < polygon.size(); ++i) {
      const Corner &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
      const double da = inside(a), db = inside(b);
      if (da >= 0) kept.push_back(a);
      if ((da > 0 && db < 0) || (da < 0 && db > 0)) {
        const double t = da / (da - db);
        kept.push_back({a.u + t * (b.u - a.u), a.v + t * (b.v - a.v)});
      }
    }
    polygon = kept;
  };
  clip([&](const Corner& c) { return c.u - u0; });
  clip([&](const Corner& c) { return u0 + 1 - c.u; });
  clip([&](const Corner& c) { return c.v - v0; });
  clip([&](const Corner& c) { return v0 + 1 - c.v; });
  double doubled = 0;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Corner &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    doubled += a.u * b.v - b.u * a.v;
  }
  return doubled / 2;
}

// The triangles cover each outer face once, with its colour, and nothing else.
void expect_covers(const SurfaceMesh& mesh, const std::map<CellFace, Rgba>& expected) {
  std::map<CellFace, double> covered;
  for (const Triangle& triangle : triangles_of(mesh)) {
    std::array<Point, 3> p{};
    for (size_t i = 0; i < 3; ++i) p[i] = point_of(mesh, triangle[i]);
    size_t axis = 0;
    while (axis < 2 && doubled_area(p, axis) == 0) ++axis;
    const int64_t area = doubled_area(p, axis);
    ASSERT_NE(area, 0) << "a triangle without area";
    ASSERT_TRUE(p[0][axis] == p[1][axis] && p[0][axis] == p[2][axis]);
    const size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    std::array<Corner, 3> flat{};
    for (size_t i = 0; i < 3; ++i) flat[i] = {double(p[i][u]), double(p[i][v])};
    if (area < 0) std::swap(flat[0], flat[1]);
    const auto [u_min, u_max] = std::minmax({p[0][u], p[1][u], p[2][u]});
    const auto [v_min, v_max] = std::minmax({p[0][v], p[1][v], p[2][v]});
    for (int at_u = u_min; at_u < u_max; ++at_u) {
      for (int at_v = v_min; at_v < v_max; ++at_v) {
        const double part = clipped_area(flat, at_u, at_v);
        if (part < 1e-9) continue;
        CellFace face{{}, static_cast<int>(axis), area > 0};
        face.corner[axis] = p[0][axis];
        face.corner[u] = at_u;
        face.corner[v] = at_v;
        covered[face] += part;
        const auto found = expected.find(face);
        ASSERT_NE(found, expected.end()) << "a triangle where no face is";
        for (const uint32_t vertex : triangle) {
          ASSERT_EQ(mesh.vertices[vertex].color, found->second);
        }
      }
    }
  }
  ASSERT_EQ(covered.size(), expected.size());
  for (const auto& [face, area] : covered) ASSERT_NEAR(area, 1, 1e-9);
}

// Each edge between two places is passed as often in one direction as in the other.
void expect_closed(const SurfaceMesh& mesh) {
  std::map<std::pair<Point, Point>, int> edges;
  for (const Triangle& triangle : triangles_of(mesh)) {
    for (size_t i = 0; i < 3; ++i) {
      const Point a = point_of(mesh, triangle[i]), b = point_of(mesh, triangle[(i + 1) % 3]);
      ASSERT_NE(a, b);
      ++edges[{a, b}];
      --edges[{b, a}];
    }
  }
  for (const auto& [edge, balance] : edges) ASSERT_EQ(balance, 0);
}

// No two vertices are the same, and each is a corner of a face.
void expect_no_needless_vertices(const SurfaceMesh& mesh) {
  std::set<std::pair<Point, Rgba>> distinct;
  for (uint32_t i = 0; i < mesh.vertices.size(); ++i) {
    distinct.insert({point_of(mesh, i), mesh.vertices[i].color});
  }
  EXPECT_EQ(distinct.size(), mesh.vertices.size());
  std::set<uint32_t> used;
  for (const Triangle& triangle : triangles_of(mesh)) used.insert(triangle.begin(), triangle.end());
  EXPECT_EQ(used.size(), mesh.vertices.size());
}

// Few colours, so that some rectangles of several faces have one.
Grid with_few_colors(Grid grid, uint32_t seed) {
  std::mt19937 random(seed);
  for (SparseTile& tile : grid.tiles) {
    for (uint8_t& sample : tile.color) sample = random() % 4 == 0 ? 40 : 200;
  }
  return grid;
}

// A ball, which has rectangles of many sizes; across the borders of eight tiles.
Grid ball(int radius, bool has_color) {
  std::vector<test::TestVoxel> voxels;
  const int centre = limits::kTileSide;
  for (int z = -radius; z <= radius; ++z) {
    for (int y = -radius; y <= radius; ++y) {
      for (int x = -radius; x <= radius; ++x) {
        if (x * x + y * y + z * z > radius * radius) continue;
        voxels.push_back({{centre + x, centre + y, centre + z}});
      }
    }
  }
  const int side = centre + radius + 1;
  return test::grid_of({side, side, side}, voxels, has_color, false);
}

std::vector<Grid> sample_grids() {
  std::vector<Grid> grids;
  for (uint32_t seed = 0; seed < 4; ++seed) {
    grids.push_back(test::random_grid(seed, {20, 9, 13}, 900, false, false));
    grids.push_back(with_few_colors(test::random_grid(seed, {12, 19, 9}, 1100, true, false), seed));
  }
  grids.push_back(ball(9, false));
  grids.push_back(with_few_colors(ball(7, true), 1));
  grids.push_back(test::random_grid(9, {300, 280, 270}, 400, true, false));
  grids.push_back(test::grid_with_a_full_brick(true, false));
  Grid full = test::grid_with_a_full_brick(false, false);
  full.tiles[0].full = {{morton_encode(2, 2, 2), 1}};  // its bricks hide each other
  grids.push_back(full);
  grids.push_back(test::grid_of({256, 1, 1}, {{{255, 0, 0}}, {{0, 0, 0}}}, false, false));
  return grids;
}

TEST(SurfaceMesh, faces_are_the_squares_between_voxels_and_empty_cells) {
  for (const Grid& grid : sample_grids()) {
    const SurfaceMesh mesh = mesh_of(grid, MeshSurface::kFaces);
    const auto expected = outer_faces(grid);
    EXPECT_EQ(mesh.faces.size(), expected.size());
    EXPECT_TRUE(std::ranges::all_of(mesh.faces.span(), &Face::is_quad));
    expect_covers(mesh, expected);
    expect_closed(mesh);
    expect_no_needless_vertices(mesh);
  }
}

TEST(SurfaceMesh, greedy_rectangles_cover_the_faces_of_their_colour_without_t_junctions) {
  for (const Grid& grid : sample_grids()) {
    const SurfaceMesh mesh = mesh_of(grid, MeshSurface::kGreedy);
    expect_covers(mesh, outer_faces(grid));
    expect_closed(mesh);
    expect_no_needless_vertices(mesh);
  }
}

TEST(SurfaceMesh, a_box_of_one_colour_is_six_quads_in_a_tile) {
  std::vector<test::TestVoxel> voxels;
  for (int z = 0; z < 5; ++z) {
    for (int y = 0; y < 70; ++y) {
      for (int x = 0; x < 17; ++x) voxels.push_back({{3 + x, 60 + y, z}});
    }
  }
  const Grid box = test::grid_of({64, 256, 8}, voxels, false, false);
  const SurfaceMesh mesh = mesh_of(box, MeshSurface::kGreedy);
  EXPECT_EQ(mesh.faces.size(), 6U);
  EXPECT_EQ(mesh.vertices.size(), 8U);
  EXPECT_EQ(mesh_of(box, MeshSurface::kFaces).faces.size(), 2U * (17 * 70 + 70 * 5 + 5 * 17));
}

TEST(SurfaceMesh, voxels_of_two_colours_share_no_vertices) {
  const Grid grid = test::grid_of(
      {2, 1, 1}, {{{0, 0, 0}, {10, 20, 30, 255}, {}}, {{1, 0, 0}, {200, 0, 0, 255}, {}}}, true,
      false);
  const SurfaceMesh mesh = mesh_of(grid, MeshSurface::kGreedy);
  EXPECT_TRUE(mesh.has_colors);
  EXPECT_EQ(mesh.faces.size(), 10U);
  EXPECT_EQ(mesh.vertices.size(), 16U);
}

TEST(SurfaceMesh, an_empty_grid_has_no_faces) {
  const Grid grid = test::grid_of({4, 4, 4}, {}, true, false);
  for (const MeshSurface surface : {MeshSurface::kFaces, MeshSurface::kGreedy}) {
    const SurfaceMesh mesh = mesh_of(grid, surface);
    EXPECT_EQ(mesh.faces.size(), 0U);
    EXPECT_EQ(mesh.vertices.size(), 0U);
  }
}

TEST(SurfaceMesh, a_solid_of_full_tiles_costs_its_surface_alone) {
  Grid grid;
  grid.spec.dims = glm::ivec3(2 * limits::kTileSide);
  for (uint32_t i = 0; i < 8; ++i) {
    const auto at = morton_decode(i);
    SparseTile& tile = grid.tiles.emplace_back();
    for (size_t c = 0; c < 3; ++c) tile.coord[c] = static_cast<int32_t>(at[c]);
    tile.full = {{0, kTileLevels}};
  }
  const mesh::VoxelBricks bricks(grid);
  const uint32_t side = 2 * mesh::kTileBricks;
  EXPECT_EQ(bricks.index().size(), side * side * side - (side - 2) * (side - 2) * (side - 2));
  const SurfaceMesh mesh = mesh_of(grid, MeshSurface::kGreedy);
  EXPECT_EQ(mesh.faces.size(), 24U);  // a quad of each tile
  EXPECT_EQ(mesh.vertices.size(), 26U);
}

TEST(SurfaceMesh, outer_voxels_are_those_with_a_face_and_have_their_colours) {
  for (const Grid& grid : sample_grids()) {
    std::map<Point, Rgba> expected;
    const auto cells = cells_of(grid);
    for (const auto& [face, color] : outer_faces(grid)) {
      Point cell = face.corner;
      if (face.up) --cell[static_cast<size_t>(face.axis)];
      expected[cell] = cells.at(cell);
    }
    const auto cubes = mesh::outer_voxels(grid, "glb");
    ASSERT_TRUE(cubes) << cubes.error().message();
    std::map<Point, Rgba> found;
    for (const mesh::Vertex& cube : cubes->span()) {
      Point cell{};
      for (size_t c = 0; c < 3; ++c) {
        cell[c] = static_cast<int>(cube.p_grid[c]);
        ASSERT_EQ(cube.p_grid[c], static_cast<float>(cell[c]) + 0.5F);
      }
      found[cell] = cube.color;
    }
    EXPECT_EQ(cubes->size(), expected.size());
    EXPECT_EQ(found, expected);
  }
}

TEST(SurfaceMesh, more_cubes_than_the_limit_are_refused) {
  const Grid grid = test::grid_of({3, 1, 1}, {{{0, 0, 0}}, {{2, 0, 0}}}, false, false);
  EXPECT_TRUE(mesh::outer_voxels(grid, "glb", 2));
  const auto refused = mesh::outer_voxels(grid, "glb", 1);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kGridTooLarge);
  EXPECT_EQ(refused.error().message(),
            "glb: too many cubes for a mesh: expected at most 1, got more");
}

TEST(SurfaceMesh, more_rectangles_than_the_limit_are_refused) {
  const Grid grid = test::grid_of({3, 1, 1}, {{{0, 0, 0}}, {{2, 0, 0}}}, false, false);
  const mesh::VoxelBricks voxels(grid);
  EXPECT_TRUE(mesh::find_rectangles(voxels, nullptr, true, "ply", 12));
  const auto refused = mesh::find_rectangles(voxels, nullptr, true, "ply", 1);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kGridTooLarge);
  EXPECT_EQ(refused.error().message(),
            "ply: too many faces for a mesh: expected at most 1, got more");
}

}  // namespace
}  // namespace voxeld
