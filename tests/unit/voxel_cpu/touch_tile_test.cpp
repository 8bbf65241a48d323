// Occupancy on the CPU against the oracle, and every instruction set and number of threads against
// each other.
#include "server/voxel/cpu/touch_tile.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "tests/reference/touch_oracle.h"
#include "tests/unit/voxel_cpu/touch_kernel_wide.h"

namespace voxeld {
namespace {

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

GridSpec grid_of(const glm::ivec3& dims) {
  GridSpec spec;
  spec.dims = dims;
  return spec;
}

SnappedMesh mesh_of(const std::vector<Triangle>& triangles, const GridSpec& spec) {
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

// By the oracle, cells inside `box`.
void add_expected(const Triangle& v, const CellBox& box, Cells& cells) {
  std::array<std::array<int64_t, 3>, 3> doubled{};
  glm::ivec3 low = v[0], high = v[0];
  for (size_t i = 0; i < 3; ++i) {
    for (int c = 0; c < 3; ++c) doubled[i][static_cast<size_t>(c)] = 2 * int64_t{v[i][c]} + 1;
    low = glm::min(low, v[i]);
    high = glm::max(high, v[i]);
  }
  low = glm::max((low >> 8) - 1, box.first);
  high = glm::min((high >> 8) + 1, box.last);
  for (int z = low.z; z <= high.z; ++z) {
    for (int y = low.y; y <= high.y; ++y) {
      for (int x = low.x; x <= high.x; ++x) {
        if (reference::touches(doubled, {x, y, z})) cells.insert({x, y, z});
      }
    }
  }
}

Cells expected_cells(const std::vector<Triangle>& triangles, const glm::ivec3& dims) {
  Cells cells;
  for (const Triangle& v : triangles) add_expected(v, {glm::ivec3(0), dims - 1}, cells);
  return cells;
}

std::vector<SparseTile> touched_tiles(CpuTouch& touch, const SnappedMesh& mesh,
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

Cells cells_of(const std::vector<SparseTile>& tiles) {
  Cells cells;
  for (const SparseTile& tile : tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t) { cells.insert({x, y, z}); });
  }
  return cells;
}

Cells touched_cells(CpuTouch& touch, const std::vector<Triangle>& triangles,
                    const glm::ivec3& dims) {
  const GridSpec spec = grid_of(dims);
  return cells_of(touched_tiles(touch, mesh_of(triangles, spec), spec));
}

// How two sets differ, for messages.
std::string difference(const Cells& got, const Cells& expected) {
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

class CpuTouchTest : public testing::TestWithParam<CpuIsa> {};

INSTANTIATE_TEST_SUITE_P(Isas, CpuTouchTest, testing::ValuesIn(supported_cpu_isas()),
                         [](const auto& isa) { return std::string(cpu_isa_name(isa.param)); });

TEST_P(CpuTouchTest, touches_what_the_oracle_says_for_small_triangles) {
  CpuTouch touch(1, GetParam());
  Soup soup(1);
  for (int round = 0; round < 60; ++round) {
    const glm::ivec3 dims(soup.integer(20, 70), soup.integer(20, 70), soup.integer(20, 70));
    std::vector<Triangle> triangles;
    for (int t = 0; t < 150; ++t)
      triangles.push_back(soup.triangle(t, soup.integer(1, 1200), dims));
    const Cells got = touched_cells(touch, triangles, dims);
    const Cells expected = expected_cells(triangles, dims);
    ASSERT_EQ(got, expected) << "round " << round << ": " << difference(got, expected);
  }
}

TEST_P(CpuTouchTest, touches_what_the_oracle_says_for_each_triangle_alone) {
  CpuTouch touch(1, GetParam());
  Soup soup(2);
  const glm::ivec3 dims(40, 50, 60);
  for (int t = 0; t < 2000; ++t) {
    const std::vector<Triangle> one = {soup.triangle(t, soup.integer(1, 7000), dims)};
    const Cells got = touched_cells(touch, one, dims);
    const Cells expected = expected_cells(one, dims);
    ASSERT_EQ(got, expected) << "triangle " << t << ": " << difference(got, expected);
  }
}

TEST_P(CpuTouchTest, triangles_at_the_limits_of_the_small_and_the_large_are_exact) {
  CpuTouch touch(1, GetParam());
  const glm::ivec3 dims(40, 40, 40);
  for (const int extent : {4095, 4096, 4097}) {
    for (const int start : {1280, 1281, 1535}) {
      // All corners of a box.
      std::vector<Triangle> triangles;
      for (int mask = 0; mask < 512; ++mask) {
        Triangle v;
        for (int i = 0; i < 3; ++i) {
          for (int c = 0; c < 3; ++c) {
            v[static_cast<size_t>(i)][c] = start + ((mask >> (3 * i + c) & 1) != 0 ? extent : 0);
          }
        }
        triangles.push_back(v);
      }
      // In turns, so that batches are of different kinds and few cover for each other.
      for (size_t first = 0; first < triangles.size(); first += 3) {
        if (first % 7 != 0) continue;
        const std::vector<Triangle> few(
            triangles.begin() + static_cast<int64_t>(first),
            triangles.begin() + static_cast<int64_t>(std::min(first + 3, triangles.size())));
        const Cells got = touched_cells(touch, few, dims);
        const Cells expected = expected_cells(few, dims);
        ASSERT_EQ(got, expected) << extent << " " << start << " " << first << ": "
                                 << difference(got, expected);
      }
    }
  }
}

TEST_P(CpuTouchTest, triangles_across_tiles_of_a_grid_with_unequal_sides_are_exact) {
  CpuTouch touch(1, GetParam());
  Soup soup(3);
  const glm::ivec3 dims(300, 9, 530);
  std::vector<Triangle> triangles;
  for (int t = 0; t < 4000; ++t) {
    Triangle v = soup.triangle(t, soup.integer(1, 2000), dims);
    // Most of them where tiles meet.
    if (t % 4 != 0) {
      const glm::ivec3 to(256 * 256, v[0].y, 256 * 256 * soup.integer(1, 2));
      const glm::ivec3 shift(to.x - v[0].x, 0, to.z - v[0].z);
      for (glm::ivec3& p : v) p = glm::clamp(p + shift, glm::ivec3(-255), dims * 256 + 254);
    }
    triangles.push_back(v);
  }
  const Cells got = touched_cells(touch, triangles, dims);
  const Cells expected = expected_cells(triangles, dims);
  ASSERT_EQ(got, expected) << difference(got, expected);
}

// Windows of cells around points of the triangle, because the oracle is slow.
TEST_P(CpuTouchTest, triangles_as_large_as_the_largest_grid_are_exact) {
  CpuTouch touch(1, GetParam());
  Soup soup(4);
  const glm::ivec3 dims(2048);
  const GridSpec spec = grid_of(dims);
  size_t checked = 0;
  for (int t = 0; t < 120; ++t) {
    const Triangle v = soup.triangle(t, 2 * 2050 * 256, dims);
    const SnappedMesh mesh = mesh_of({v}, spec);
    const int a = soup.integer(0, 1000), b = soup.integer(0, 1000 - a);
    const glm::dvec3 on = (glm::dvec3(v[0]) * double(a) + glm::dvec3(v[1]) * double(b) +
                           glm::dvec3(v[2]) * double(1000 - a - b)) /
                          256'000.0;
    const glm::ivec3 cell = glm::clamp(glm::ivec3(on), glm::ivec3(0), dims - 1);
    TileBin bin;
    bin.coord = cell / 256;
    const uint32_t index = 0;
    bin.triangles = std::span(&index, 1);
    const CellBox window = {glm::max(cell - 6, bin.coord * 256),
                            glm::min(cell + 6, bin.coord * 256 + 255)};
    SparseTile tile;
    tile.coord = {bin.coord.x, bin.coord.y, bin.coord.z};
    touch.run(mesh, spec, bin, tile);
    Cells got, expected;
    for_each_voxel(tile, [&](int x, int y, int z, size_t) {
      const glm::ivec3 p(x, y, z);
      if (glm::all(glm::greaterThanEqual(p, window.first)) &&
          glm::all(glm::lessThanEqual(p, window.last))) {
        got.insert({x, y, z});
      }
    });
    add_expected(v, window, expected);
    checked += expected.size();
    ASSERT_EQ(got, expected) << "triangle " << t << ": " << difference(got, expected);
  }
  EXPECT_GT(checked, 10'000u);
}

// Small, large and awkward ones together.
std::vector<Triangle> mixed_soup(Soup& soup, const glm::ivec3& dims) {
  std::vector<Triangle> triangles;
  for (int t = 0; t < 9000; ++t) triangles.push_back(soup.triangle(t, soup.integer(1, 1500), dims));
  for (int t = 0; t < 300; ++t) triangles.push_back(soup.triangle(t, soup.integer(1, 9000), dims));
  for (int t = 0; t < 24; ++t) triangles.push_back(soup.triangle(t, 150'000, dims));
  soup.shuffle(triangles);
  return triangles;
}

TEST(CpuTouch, gives_the_same_bits_by_every_instruction_set_thread_count_and_order) {
  Soup soup(5);
  const glm::ivec3 dims(300, 256, 280);
  const GridSpec spec = grid_of(dims);
  std::vector<Triangle> triangles = mixed_soup(soup, dims);
  CpuTouch plain(1, CpuIsa::kPortable);
  const std::vector<SparseTile> expected = touched_tiles(plain, mesh_of(triangles, spec), spec);
  ASSERT_EQ(expected.size(), 4u);
  for (const CpuIsa isa : supported_cpu_isas()) {
    for (int threads = 1; threads <= 5; ++threads) {
      soup.shuffle(triangles);
      for (Triangle& v : triangles) std::rotate(v.begin(), v.begin() + 1, v.end());
      CpuTouch touch(threads, isa);
      const SnappedMesh mesh = mesh_of(triangles, spec);
      ASSERT_EQ(touched_tiles(touch, mesh, spec), expected)
          << cpu_isa_name(isa) << ", " << threads << " threads";
      // All tiles in one call.
      const TileBins bins(mesh, spec.tile_dims());
      std::vector<SparseTile> tiles(bins.bins().size());
      for (size_t i = 0; i < tiles.size(); ++i) tiles[i].coord = expected[i].coord;
      touch.run(mesh, spec, bins.bins(), tiles);
      ASSERT_EQ(tiles, expected) << cpu_isa_name(isa) << ", " << threads << " threads, all tiles";
    }
  }
}

TEST(CpuTouch, lanes_as_many_as_avx512_has_give_the_same_bits) {
  Soup soup(6);
  const glm::ivec3 dims(256);
  const GridSpec spec = grid_of(dims);
  const SnappedMesh mesh = mesh_of(mixed_soup(soup, dims), spec);
  const TileBins bins(mesh, spec.tile_dims());
  ASSERT_EQ(bins.bins().size(), 1u);
  const TouchInput input = touch_input(mesh, spec, bins.bins()[0]);
  const auto mask_of = [&](const TouchKernel& kernel) {
    std::vector<uint64_t> words(kTouchWords);
    std::vector<uint32_t> mask(2 * kTileWords);
    uint64_t* tile = words.data();
    for (uint64_t blocks = kernel.touch(input, tile); blocks != 0; blocks &= blocks - 1) {
      kernel.join(&tile, 1, static_cast<size_t>(std::countr_zero(blocks)), mask.data());
    }
    return mask;
  };
  EXPECT_TRUE(mask_of(kTouchKernelWide) == mask_of(kTouchKernelPortable));
}

TEST(CpuTouch, a_mask_holds_the_same_voxels_and_its_old_contents_do_not_matter) {
  Soup soup(7);
  const glm::ivec3 dims(256, 100, 256);
  const GridSpec spec = grid_of(dims);
  for (const int threads : {1, 3}) {
    CpuTouch touch(threads);
    std::vector<uint32_t> mask(2 * kTileWords, 0xdeadbeefu);
    for (int round = 0; round < 3; ++round) {
      std::vector<Triangle> triangles;
      for (int t = 0; t < 4000; ++t) triangles.push_back(soup.triangle(t, 900, dims));
      const SnappedMesh mesh = mesh_of(triangles, spec);
      const TileBins bins(mesh, spec.tile_dims());
      SparseTile tile;
      const uint64_t voxels = touch.run(mesh, spec, bins.bins()[0], tile);
      const uint64_t blocks = touch.run(mesh, spec, bins.bins()[0], mask);
      SparseTile from_mask;
      uint64_t counted = 0;
      for (uint32_t brick = 0; brick < kTileWords / kBrickWords64; ++brick) {
        if ((blocks >> brick / kBlockBricks & 1) == 0) continue;
        BrickMask words;
        for (size_t w = 0; w < 16; ++w) {
          words.words[w / 2] |= uint64_t{mask[size_t{brick} * 16 + w]} << (32 * (w % 2));
        }
        if (words == BrickMask{}) continue;
        from_mask.brick_morton.push_back(brick);
        from_mask.masks.push_back(words);
      }
      counted = from_mask.voxel_count();
      EXPECT_EQ(counted, voxels);
      EXPECT_TRUE(from_mask == tile) << "round " << round;
    }
  }
}

TEST(CpuTouch, an_empty_bin_touches_nothing) {
  CpuTouch touch(2);
  const SnappedMesh mesh;
  SparseTile tile;
  EXPECT_EQ(touch.run(mesh, grid_of(glm::ivec3(64)), TileBin{}, tile), 0u);
  EXPECT_TRUE(tile.masks.empty());
}

}  // namespace
}  // namespace voxeld
