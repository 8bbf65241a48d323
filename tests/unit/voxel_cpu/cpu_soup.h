// Triangles of all kinds, and what CpuTouch makes of them.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <deque>
#include <iterator>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "server/voxel/cpu/touch_tile.h"

namespace voxeld::cpu_soup {

using Triangle = std::array<glm::ivec3, 3>;  // q
using Cells = std::set<std::array<int, 3>>;

struct CellBox {
  glm::ivec3 first, last;  // inclusive
};

// Corners of triangles of all kinds, from a fixed seed.
class Soup {
 public:
  explicit Soup(uint64_t seed) : random_(seed) {}

  int integer(int low, int high) {
    return low + static_cast<int>(random_() % static_cast<uint64_t>(high - low + 1));
  }
  glm::ivec3 point(const glm::ivec3& low, const glm::ivec3& high) {
    return {integer(low.x, high.x), integer(low.y, high.y), integer(low.z, high.z)};
  }

  // Triangle number t, at most `size` wide, in the grid and up to a cell around it; most numbers
  // modulo 12 are of an awkward kind.
  Triangle triangle(int t, int size, const glm::ivec3& dims) {
    const glm::ivec3 centre = point(glm::ivec3(-300), dims * 256 + 300);
    Triangle v;
    for (glm::ivec3& p : v) {
      p = centre + point(glm::ivec3(-size / 2), glm::ivec3(size / 2));
      if (t % 12 == 1) p = (p >> 8) << 8;  // on grid planes
      if (t % 12 == 2) p.x = centre.x;     // parallel to one
      if (t % 12 == 3) p.y = (centre.y >> 8) * 256 + 255;
      if (t % 12 == 4) p.z = centre.z;
    }
    if (t % 12 == 5) v[2] = v[0];
    if (t % 12 == 6) v[1] = v[2] = v[0];
    if (t % 12 == 7) v[2] = v[0] + (v[1] - v[0]) / 3;  // almost on a line
    if (t % 12 == 8) v[2] = (v[0] + v[1]) / 2 + point(glm::ivec3(-3), glm::ivec3(3));
    if (t % 12 == 9) v[1] = v[0] + glm::ivec3(v[1].x - v[0].x, 0, 0);  // a side along x
    if (t % 12 == 10) v[2] = 2 * v[1] - v[0];                          // exactly on a line
    for (glm::ivec3& p : v) p = glm::clamp(p, glm::ivec3(-255), dims * 256 + 254);
    return v;
  }

  template <typename T>
  void shuffle(std::vector<T>& values) {
    std::shuffle(values.begin(), values.end(), random_);
  }

 private:
  std::mt19937_64 random_;
};

inline GridSpec grid_of(const glm::ivec3& dims) {
  GridSpec spec;
  spec.dims = dims;
  return spec;
}

inline SnappedMesh mesh_of(const std::vector<Triangle>& triangles, const GridSpec& spec) {
  Scene scene;
  scene.parts.emplace_back();
  for (const Triangle& v : triangles) {
    for (const glm::ivec3& q : v) {
      scene.parts[0].indices.push_back(static_cast<uint32_t>(scene.parts[0].positions.size()));
      scene.parts[0].positions.push_back((glm::dvec3(q) + 0.5) / 256.0);
    }
  }
  auto mesh = snap_scene(scene, glm::dmat4(1.0), spec);
  EXPECT_TRUE(mesh.ok());
  for (size_t i = 0; i < 3 * triangles.size(); ++i) {
    const glm::ivec3 q = triangles[i / 3][i % 3];
    // Snapping keeps a layer of 1/4096 voxel around the grid for it.
    EXPECT_EQ(mesh->vertices[i], q);
  }
  return std::move(*mesh);
}

inline std::vector<SparseTile> touched_tiles(CpuTouch& touch, const SnappedMesh& mesh,
                                             const GridSpec& spec) {
  const TileBins bins(mesh, spec.tile_dims());
  std::vector<SparseTile> tiles(bins.bins().size());
  uint64_t voxels = 0;
  for (size_t i = 0; i < tiles.size(); ++i) {
    const glm::ivec3& coord = bins.bins()[i].coord;
    tiles[i].coord = {coord.x, coord.y, coord.z};
    voxels += touch.run(mesh, spec, bins.bins()[i], tiles[i]);
  }
  uint64_t counted = 0;
  for (const SparseTile& tile : tiles) {
    counted += tile.voxel_count();
    EXPECT_TRUE(std::is_sorted(tile.brick_morton.begin(), tile.brick_morton.end()));
  }
  EXPECT_EQ(voxels, counted);
  return tiles;
}

inline Cells cells_of(const std::vector<SparseTile>& tiles) {
  Cells cells;
  for (const SparseTile& tile : tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t) { cells.insert({x, y, z}); });
  }
  return cells;
}

inline Cells touched_cells(CpuTouch& touch, const std::vector<Triangle>& triangles,
                           const glm::ivec3& dims) {
  const GridSpec spec = grid_of(dims);
  return cells_of(touched_tiles(touch, mesh_of(triangles, spec), spec));
}

// The cells of a bin's tile inside `window`.
inline Cells cells_in(const CellBox& window, CpuTouch& touch, const SnappedMesh& mesh,
                      const GridSpec& spec, const TileBin& bin) {
  SparseTile tile;
  tile.coord = {bin.coord.x, bin.coord.y, bin.coord.z};
  touch.run(mesh, spec, bin, tile);
  Cells cells;
  for_each_voxel(tile, [&](int x, int y, int z, size_t) {
    const glm::ivec3 p(x, y, z);
    if (glm::all(glm::greaterThanEqual(p, window.first)) &&
        glm::all(glm::lessThanEqual(p, window.last))) {
      cells.insert({x, y, z});
    }
  });
  return cells;
}

// How two sets differ, for messages.
inline std::string difference(const Cells& got, const Cells& expected) {
  std::vector<std::array<int, 3>> cells;
  std::set_symmetric_difference(got.begin(), got.end(), expected.begin(), expected.end(),
                                std::back_inserter(cells));
  std::string text = std::to_string(cells.size()) + " cells differ:";
  for (size_t i = 0; i < std::min<size_t>(cells.size(), 5); ++i) {
    text += " (" + std::to_string(cells[i][0]) + ", " + std::to_string(cells[i][1]) + ", " +
            std::to_string(cells[i][2]) + ")" + (got.contains(cells[i]) ? " extra" : " missing");
  }
  return text;
}

// Each supported instruction set, on one thread. One run of the oracle serves all of them: it takes
// most of the time of a test.
class TouchOfIsas {
 public:
  explicit TouchOfIsas(Rule rule = Rule::kTouch) {
    for (const CpuIsa isa : supported_cpu_isas()) all_.emplace_back(isa).touch.set_rule(rule);
  }

  // Calls visit(touch, name of the instruction set).
  template <typename Visit>
  void for_each(const Visit& visit) {
    for (One& one : all_) visit(one.touch, std::string(cpu_isa_name(one.isa)));
  }

  void expect_cells(const std::vector<Triangle>& triangles, const glm::ivec3& dims,
                    const Cells& expected, const std::string& what) {
    for_each([&](CpuTouch& touch, const std::string& isa) {
      const Cells got = touched_cells(touch, triangles, dims);
      ASSERT_EQ(got, expected) << isa << ", " << what << ": " << difference(got, expected);
    });
  }

 private:
  struct One {
    explicit One(CpuIsa its_isa) : isa(its_isa), touch(1, its_isa) {}
    CpuIsa isa;
    CpuTouch touch;
  };
  std::deque<One> all_;
};

// Small, large and awkward ones together.
inline std::vector<Triangle> mixed_soup(Soup& soup, const glm::ivec3& dims) {
  std::vector<Triangle> triangles;
  for (int t = 0; t < 9000; ++t) triangles.push_back(soup.triangle(t, soup.integer(1, 1500), dims));
  for (int t = 0; t < 300; ++t) triangles.push_back(soup.triangle(t, soup.integer(1, 9000), dims));
  for (int t = 0; t < 24; ++t) triangles.push_back(soup.triangle(t, 150'000, dims));
  soup.shuffle(triangles);
  return triangles;
}

}  // namespace voxeld::cpu_soup
