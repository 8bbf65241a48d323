// Occupancy on the CPU against the oracle, and every instruction set and number of threads against
// each other.
#include "server/voxel/cpu/touch_tile.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "server/base/cancel_point.h"
#include "tests/reference/touch_oracle.h"
#include "tests/unit/voxel_cpu/cpu_soup.h"
#include "tests/unit/voxel_cpu/touch_kernel_wide.h"

namespace voxeld {
namespace {

using namespace cpu_soup;  // NOLINT(google-build-using-namespace)

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

// By every instruction set.
void expect_oracle(TouchOfIsas& isas, const std::vector<Triangle>& triangles,
                   const glm::ivec3& dims, const std::string& what) {
  isas.expect_cells(triangles, dims, expected_cells(triangles, dims), what);
}

TEST(CpuTouch, small_triangles_touch_the_cells_of_the_oracle) {
  TouchOfIsas isas;
  Soup soup(1);
  for (int round = 0; round < 60; ++round) {
    const glm::ivec3 dims(soup.integer(20, 70), soup.integer(20, 70), soup.integer(20, 70));
    std::vector<Triangle> triangles;
    for (int t = 0; t < 150; ++t)
      triangles.push_back(soup.triangle(t, soup.integer(1, 1200), dims));
    ASSERT_NO_FATAL_FAILURE(expect_oracle(isas, triangles, dims, "round " + std::to_string(round)));
  }
}

TEST(CpuTouch, each_triangle_alone_touches_the_cells_of_the_oracle) {
  TouchOfIsas isas;
  Soup soup(2);
  const glm::ivec3 dims(40, 50, 60);
  for (int t = 0; t < 2000; ++t) {
    const std::vector<Triangle> one = {soup.triangle(t, soup.integer(1, 7000), dims)};
    ASSERT_NO_FATAL_FAILURE(expect_oracle(isas, one, dims, "triangle " + std::to_string(t)));
  }
}

TEST(CpuTouch, triangles_at_the_limits_of_the_small_and_the_large_are_exact) {
  TouchOfIsas isas;
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
        ASSERT_NO_FATAL_FAILURE(expect_oracle(
            isas, few, dims,
            std::to_string(extent) + " " + std::to_string(start) + " " + std::to_string(first)));
      }
    }
  }
}

TEST(CpuTouch, triangles_across_tiles_of_a_grid_with_unequal_sides_are_exact) {
  TouchOfIsas isas;
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
  expect_oracle(isas, triangles, dims, "soup");
}

// Windows of cells around points of the triangle, because the oracle is slow.
TEST(CpuTouch, triangles_as_large_as_the_largest_grid_are_exact) {
  TouchOfIsas isas;
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
    Cells expected;
    add_expected(v, window, expected);
    checked += expected.size();
    isas.for_each([&](CpuTouch& touch, const std::string& isa) {
      const Cells got = cells_in(window, touch, mesh, spec, bin);
      EXPECT_EQ(got, expected) << isa << ", triangle " << t << ": " << difference(got, expected);
    });
    ASSERT_FALSE(HasFailure());
  }
  EXPECT_GT(checked, 10'000u);
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

TEST(CpuTouch, a_cancelled_call_leaves_nothing_to_the_next) {
  Soup soup(7);
  const glm::ivec3 dims(256);
  const GridSpec spec = grid_of(dims);
  std::vector<Triangle> triangles;
  while (triangles.size() < 20'000)
    std::ranges::copy(mixed_soup(soup, dims), std::back_inserter(triangles));
  const std::vector<Triangle> few(triangles.begin(), triangles.begin() + 10);
  const SnappedMesh all_mesh = mesh_of(triangles, spec), few_mesh = mesh_of(few, spec);
  CpuTouch plain(1);
  const std::vector<SparseTile> expected = touched_tiles(plain, few_mesh, spec);
  for (const int threads : {1, 2}) {
    CpuTouch touch(threads);
    for (int points = 2; points < 6; ++points) {
      std::atomic<bool> flag{false};
      const CancelScope scope(flag);
      std::thread cancel([&] {
        for (int passed = 0; passed < points;) passed += scope.has_passed_points() ? 1 : 0;
        flag = true;
      });
      // As often as it takes for the flag to be seen.
      const auto run = [&] {
        while (true) (void)touched_tiles(touch, all_mesh, spec);
      };
      EXPECT_THROW(run(), Cancelled);
      cancel.join();
      flag = false;
      EXPECT_EQ(touched_tiles(touch, few_mesh, spec), expected);
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
