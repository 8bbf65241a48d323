// rule=thin and rule=center on the CPU against the oracle, every instruction set and number of
// threads against each other, and what the definitions promise.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "server/voxel/cpu/touch_tile.h"
#include "tests/reference/line_oracle.h"
#include "tests/unit/voxel_cpu/cpu_soup.h"
#include "tests/unit/voxel_cpu/touch_kernel_wide.h"

namespace voxeld {
namespace {

using namespace cpu_soup;  // NOLINT(google-build-using-namespace)

// Triangles for which closedness matters: number t modulo 4 is
// 0: seen edge-on along an axis, over a line that runs through centres of columns;
// 1: the same without area;
// 2: corners next to centres and to corners of cells, so that sides run through centres;
// 3: two corners on either side of a centre, exactly opposite.
Triangle tied_triangle(Soup& soup, int t, int size, const glm::ivec3& dims) {
  const int axis = soup.integer(0, 2), x = (axis + 1) % 3, y = (axis + 2) % 3;
  const glm::ivec3 cell = soup.point(glm::ivec3(0), dims - 1);
  const int ratio = 2 * soup.integer(-3, 2) + 1, half = std::max(1, size / 14);
  Triangle v;
  for (size_t i = 0; i < 3; ++i) {
    // 2 q + 1 = 512 cell + 256 + odd.
    const int odd = 2 * soup.integer(-half, half) + 1;
    v[i][x] = 256 * cell[x] + (255 + odd) / 2;
    v[i][y] = 256 * cell[y] + (255 + odd * ratio) / 2;
    v[i][axis] = 256 * cell[axis] + soup.integer(-half, half);
    if (t % 4 == 1 && i > 0) v[i][axis] = v[0][axis] + (v[i][x] - v[0][x]);
    if (t % 4 == 2) {
      for (int c = 0; c < 3; ++c) {
        v[i][c] = 128 * (v[i][c] / 128) - soup.integer(0, 1);
      }
    }
  }
  if (t % 4 == 3) {
    v[1] = 2 * (256 * cell + 127) + 1 - v[0];
    v[2] = soup.point(glm::min(v[0], v[1]) - half, glm::max(v[0], v[1]) + half);
  }
  for (glm::ivec3& p : v) p = glm::clamp(p, glm::ivec3(-255), dims * 256 + 254);
  return v;
}

bool occupies(Rule rule, const Triangle& v, const std::array<int, 3>& cell) {
  reference::Snapped doubled{};
  for (size_t i = 0; i < 3; ++i) {
    for (int c = 0; c < 3; ++c) doubled[i][static_cast<size_t>(c)] = 2 * int64_t{v[i][c]} + 1;
  }
  return rule == Rule::kThin ? reference::occupies_thin(doubled, cell)
                             : reference::occupies_center(doubled, cell);
}

// By the oracle, cells inside `box`.
void add_expected(Rule rule, const Triangle& v, const CellBox& box, Cells& cells) {
  const glm::ivec3 low = glm::max((glm::min(v[0], glm::min(v[1], v[2])) >> 8) - 1, box.first);
  const glm::ivec3 high = glm::min((glm::max(v[0], glm::max(v[1], v[2])) >> 8) + 1, box.last);
  for (int z = low.z; z <= high.z; ++z) {
    for (int y = low.y; y <= high.y; ++y) {
      for (int x = low.x; x <= high.x; ++x) {
        if (!cells.contains({x, y, z}) && occupies(rule, v, {x, y, z})) cells.insert({x, y, z});
      }
    }
  }
}

// By the oracle, column by column.
Cells expected_cells(Rule rule, const std::vector<Triangle>& triangles, const glm::ivec3& dims) {
  std::vector<reference::Triangle> points;
  for (const Triangle& v : triangles) {
    reference::Triangle& triangle = points.emplace_back();
    for (size_t i = 0; i < 3; ++i) {
      for (int c = 0; c < 3; ++c) triangle[i][static_cast<size_t>(c)] = (v[i][c] + 0.5) / 256;
    }
  }
  const reference::OracleGrid grid = {{dims.x, dims.y, dims.z}, {0, 0, 0}, {1, 1, 1}};
  const reference::Occupancy occupied = rule == Rule::kThin ? reference::thin_cells(points, grid)
                                                            : reference::center_cells(points, grid);
  Cells cells;
  size_t at = 0;
  for (int z = 0; z < dims.z; ++z) {
    for (int y = 0; y < dims.y; ++y) {
      for (int x = 0; x < dims.x; ++x, ++at) {
        if (occupied[at] != 0) cells.insert({x, y, z});
      }
    }
  }
  return cells;
}

std::string name_of(Rule rule) {
  return rule == Rule::kThin ? "thin" : "center";
}

class CpuLinesTest : public testing::TestWithParam<Rule> {
 protected:
  // By every instruction set.
  void expect_oracle(const std::vector<Triangle>& triangles, const glm::ivec3& dims,
                     const std::string& what) {
    const Cells expected = expected_cells(GetParam(), triangles, dims);
    isas_.expect_cells(triangles, dims, expected, what);
    cells_ += expected.size();
  }

  TouchOfIsas isas_{GetParam()};
  size_t cells_ = 0;  // that were compared
};

INSTANTIATE_TEST_SUITE_P(Rules, CpuLinesTest, testing::Values(Rule::kThin, Rule::kCenter),
                         [](const auto& p) { return name_of(p.param); });

TEST_P(CpuLinesTest, small_triangles_match_the_oracle) {
  Soup soup(21);
  for (int round = 0; round < 60; ++round) {
    const glm::ivec3 dims(soup.integer(20, 60), soup.integer(20, 60), soup.integer(20, 60));
    std::vector<Triangle> triangles;
    for (int t = 0; t < 200; ++t) {
      triangles.push_back(soup.triangle(t, soup.integer(1, 1200), dims));
      triangles.push_back(tied_triangle(soup, t, soup.integer(1, 1200), dims));
    }
    ASSERT_NO_FATAL_FAILURE(expect_oracle(triangles, dims, "round " + std::to_string(round)));
  }
  EXPECT_GT(cells_, 5'000u);
}

TEST_P(CpuLinesTest, each_triangle_alone_matches_the_oracle) {
  Soup soup(22);
  const glm::ivec3 dims(40, 50, 60);
  for (int t = 0; t < 3000; ++t) {
    const int size = soup.integer(1, t % 8 == 0 ? 8000 : 3000);
    ASSERT_NO_FATAL_FAILURE(
        expect_oracle({soup.triangle(t, size, dims)}, dims, "triangle " + std::to_string(t)));
    ASSERT_NO_FATAL_FAILURE(
        expect_oracle({tied_triangle(soup, t, size, dims)}, dims, "tied " + std::to_string(t)));
  }
  EXPECT_GT(cells_, 10'000u);
}

TEST_P(CpuLinesTest, triangles_at_the_limits_of_the_small_and_the_large_are_exact) {
  const glm::ivec3 dims(40, 40, 40);
  for (const int extent : {4095, 4096, 4097}) {
    for (const int start : {1280, 1407, 1535}) {
      // All corners of a box.
      for (int mask = 0; mask < 512; mask += 7) {
        Triangle v;
        for (int i = 0; i < 3; ++i) {
          for (int c = 0; c < 3; ++c) {
            v[static_cast<size_t>(i)][c] = start + ((mask >> (3 * i + c) & 1) != 0 ? extent : 0);
          }
        }
        ASSERT_NO_FATAL_FAILURE(expect_oracle(
            {v}, dims,
            std::to_string(extent) + " " + std::to_string(start) + " " + std::to_string(mask)));
      }
    }
  }
}

TEST_P(CpuLinesTest, triangles_across_tiles_of_a_grid_with_unequal_sides_are_exact) {
  Soup soup(23);
  const glm::ivec3 dims(300, 9, 530);
  std::vector<Triangle> triangles;
  for (int t = 0; t < 1500; ++t) {
    const int size = soup.integer(1, 2000);
    Triangle v = t % 2 == 0 ? soup.triangle(t, size, dims) : tied_triangle(soup, t / 2, size, dims);
    // Most of them where tiles meet; whole cells keep ties.
    if (t % 4 != 0) {
      const glm::ivec3 to(256, 0, 256 * soup.integer(1, 2));
      const glm::ivec3 shift = (to - glm::ivec3(v[0].x >> 8, 0, v[0].z >> 8)) * 256;
      for (glm::ivec3& p : v) p = glm::clamp(p + shift, glm::ivec3(-255), dims * 256 + 254);
    }
    triangles.push_back(v);
  }
  expect_oracle(triangles, dims, "soup");
}

// Windows of cells around points of the triangle, because the oracle is slow.
TEST_P(CpuLinesTest, triangles_as_large_as_the_largest_grid_are_exact) {
  Soup soup(24);
  const glm::ivec3 dims(2048);
  const GridSpec spec = grid_of(dims);
  for (int t = 0; t < 80; ++t) {
    const int size = 2 * 2050 * 256;
    const Triangle v =
        t % 2 == 0 ? soup.triangle(t, size, dims) : tied_triangle(soup, t / 2, size, dims);
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
    const CellBox window = {glm::max(cell - 5, bin.coord * 256),
                            glm::min(cell + 5, bin.coord * 256 + 255)};
    Cells expected;
    add_expected(GetParam(), v, window, expected);
    cells_ += expected.size();
    isas_.for_each([&](CpuTouch& touch, const std::string& isa) {
      const Cells got = cells_in(window, touch, mesh, spec, bin);
      EXPECT_EQ(got, expected) << isa << ", triangle " << t << ": " << difference(got, expected);
    });
    ASSERT_FALSE(HasFailure());
  }
  EXPECT_GT(cells_, 2'000u);
}

std::vector<Triangle> soup_with_ties(Soup& soup, const glm::ivec3& dims) {
  std::vector<Triangle> triangles = mixed_soup(soup, dims);
  for (int t = 0; t < 2000; ++t) {
    triangles.push_back(tied_triangle(soup, t, soup.integer(1, 6000), dims));
  }
  soup.shuffle(triangles);
  return triangles;
}

TEST(CpuLines, give_the_same_bits_by_every_instruction_set_thread_count_and_order) {
  for (const Rule rule : {Rule::kThin, Rule::kCenter}) {
    Soup soup(25);
    const glm::ivec3 dims(300, 256, 280);
    const GridSpec spec = grid_of(dims);
    std::vector<Triangle> triangles = soup_with_ties(soup, dims);
    CpuTouch plain(1, CpuIsa::kPortable);
    plain.set_rule(rule);
    const std::vector<SparseTile> expected = touched_tiles(plain, mesh_of(triangles, spec), spec);
    ASSERT_EQ(expected.size(), 4u);
    for (const CpuIsa isa : supported_cpu_isas()) {
      for (int threads = 1; threads <= 3; ++threads) {
        soup.shuffle(triangles);
        for (Triangle& v : triangles) {
          std::rotate(v.begin(), v.begin() + 1, v.end());
          if (threads == 2) std::swap(v[0], v[1]);
        }
        CpuTouch touch(threads, isa);
        touch.set_rule(rule);
        ASSERT_EQ(touched_tiles(touch, mesh_of(triangles, spec), spec), expected)
            << name_of(rule) << " " << cpu_isa_name(isa) << ", " << threads << " threads";
      }
    }
  }
}

TEST(CpuLines, lanes_as_many_as_avx512_has_give_the_same_bits) {
  Soup soup(26);
  const glm::ivec3 dims(256);
  const GridSpec spec = grid_of(dims);
  const SnappedMesh mesh = mesh_of(soup_with_ties(soup, dims), spec);
  const TileBins bins(mesh, spec.tile_dims());
  const TouchInput input = touch_input(mesh, spec, bins.bins()[0]);
  std::vector<uint64_t> wide(kTouchWords), plain(kTouchWords);
  EXPECT_EQ(kTouchKernelWide.thin(input, wide.data()),
            kTouchKernelPortable.thin(input, plain.data()));
  EXPECT_TRUE(wide == plain);
  std::ranges::fill(wide, 0u);
  std::ranges::fill(plain, 0u);
  EXPECT_EQ(kTouchKernelWide.center(input, wide.data()),
            kTouchKernelPortable.center(input, plain.data()));
  EXPECT_TRUE(wide == plain);
}

Cells cells_by(Rule rule, const std::vector<Triangle>& triangles, const glm::ivec3& dims) {
  CpuTouch touch(1);
  touch.set_rule(rule);
  return touched_cells(touch, triangles, dims);
}

TEST(CpuLines, center_is_a_subset_of_thin_and_thin_of_touch) {
  Soup soup(27);
  const glm::ivec3 dims(120, 90, 300);
  for (int round = 0; round < 10; ++round) {
    std::vector<Triangle> triangles;
    for (int t = 0; t < 150; ++t) {
      triangles.push_back(soup.triangle(t, soup.integer(1, 9000), dims));
      triangles.push_back(tied_triangle(soup, t, soup.integer(1, 9000), dims));
    }
    const Cells touched = cells_by(Rule::kTouch, triangles, dims);
    const Cells thin = cells_by(Rule::kThin, triangles, dims);
    const Cells center = cells_by(Rule::kCenter, triangles, dims);
    EXPECT_TRUE(std::ranges::includes(touched, thin));
    EXPECT_TRUE(std::ranges::includes(thin, center));
    EXPECT_GT(touched.size(), thin.size());
    EXPECT_GT(thin.size(), center.size());
    EXPECT_GT(center.size(), 1000u);
  }
}

TEST(CpuLines, rule_none_occupies_nothing) {
  Soup soup(28);
  const glm::ivec3 dims(64);
  EXPECT_TRUE(cells_by(Rule::kNone, mixed_soup(soup, dims), dims).empty());
}

// Corners around a side that is shared, over centres of columns: `center` gives each to one
// triangle, whichever way the diagonal runs, and no hole and no second layer is left.
TEST(CpuLines, squares_between_centres_are_covered_once_by_their_two_triangles) {
  const glm::ivec3 dims(16, 16, 8);
  for (const bool turned : {false, true}) {
    // Centres 2 to 11 in x, and 2 to 11 or 3 to 12 in y; diagonals a to c or b to d over ten.
    const int y = turned ? 128 : 127;
    const glm::ivec3 a(2 * 256 + 127, 2 * 256 + y, 1000), c(12 * 256 + 127, 12 * 256 + y, 1000);
    const glm::ivec3 b(c.x, a.y, 1000), d(a.x, c.y, 1000);
    const Triangle first = turned ? Triangle{b, c, d} : Triangle{a, b, c};
    const Triangle second = turned ? Triangle{b, d, a} : Triangle{a, c, d};
    const Cells one = cells_by(Rule::kCenter, {first}, dims);
    const Cells two = cells_by(Rule::kCenter, {second}, dims);
    const Cells all = cells_by(Rule::kCenter, {first, second}, dims);
    EXPECT_EQ(all.size(), 100u);
    EXPECT_EQ(one.size() + two.size(), 100u);
    // Closed, both triangles have the diagonal's.
    const Cells thin = cells_by(Rule::kThin, {first}, dims);
    EXPECT_EQ(thin.size() + cells_by(Rule::kThin, {second}, dims).size(), 110u);
  }
}

// Points of a sphere that is closed and as coarse as `steps`, around the grid's middle.
std::vector<Triangle> sphere(int steps, double radius, const glm::dvec3& centre) {
  const auto point = [&](int i, int j) {
    const double pi = 3.14159265358979323846;
    const double theta = pi * i / steps, phi = pi * (j % (2 * steps)) / steps;
    const double ring = i == 0 || i == steps ? 0.0 : std::sin(theta);
    const glm::dvec3 p =
        centre + radius * glm::dvec3(ring * std::cos(phi), std::cos(theta), ring * std::sin(phi));
    return glm::ivec3(glm::floor(p * 256.0));
  };
  std::vector<Triangle> triangles;
  for (int i = 0; i < steps; ++i) {
    for (int j = 0; j < 2 * steps; ++j) {
      triangles.push_back({point(i, j), point(i + 1, j), point(i + 1, j + 1)});
      triangles.push_back({point(i, j), point(i + 1, j + 1), point(i, j + 1)});
    }
  }
  return triangles;
}

reference::Occupancy dense(const Cells& cells, const glm::ivec3& dims) {
  reference::Occupancy all(static_cast<size_t>(dims.x) * dims.y * dims.z);
  for (const auto& [x, y, z] : cells) {
    all[static_cast<size_t>(x + dims.x * (y + dims.y * z))] = 1;
  }
  return all;
}

TEST(CpuLines, thin_cells_of_a_closed_mesh_separate_the_inside_from_the_outside) {
  const glm::ivec3 dims(64);
  const reference::OracleGrid grid = {{64, 64, 64}, {0, 0, 0}, {1, 1, 1}};
  for (const int steps : {2, 3, 7, 40, 150}) {
    for (const double shift : {0.0, 0.25, 0.5}) {
      const std::vector<Triangle> triangles =
          sphere(steps, 29.3, glm::dvec3(32 + shift, 32 - shift, 32));
      const Cells thin = cells_by(Rule::kThin, triangles, dims);
      const reference::Occupancy occupied = dense(thin, dims);
      EXPECT_TRUE(reference::is_enclosed(occupied, grid, {32, 32, 32})) << steps << " " << shift;
      // And the test can fail: with any one of a few cells taken away, of those the surface crosses
      // straight along an axis, there is a way out.
      reference::Occupancy holed = occupied;
      for (int x = 0; x < 32; ++x) holed[static_cast<size_t>(x + 64 * (32 + 64 * 32))] = 0;
      EXPECT_FALSE(reference::is_enclosed(holed, grid, {32, 32, 32}));
    }
  }
}

TEST(CpuLines, faces_along_the_axes_give_one_layer) {
  const glm::ivec3 dims(20);
  for (const Rule rule : {Rule::kThin, Rule::kCenter}) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const int plane : {0, 127, 128, 255, 256, 19 * 256 + 255}) {
        // Over all centres of the grid.
        Triangle a, b;
        const auto corner = [&](bool u, bool v) {
          glm::ivec3 p;
          p[axis] = plane;
          p[(axis + 1) % 3] = u ? 20 * 256 - 1 : 0;
          p[(axis + 2) % 3] = v ? 20 * 256 - 1 : 0;
          return p;
        };
        a = {corner(false, false), corner(true, false), corner(true, true)};
        b = {corner(false, false), corner(true, true), corner(false, true)};
        const Cells cells = cells_by(rule, {a, b}, dims);
        EXPECT_EQ(cells.size(), 400u) << name_of(rule) << " " << axis << " " << plane;
        for (const auto& cell : cells) EXPECT_EQ(cell[static_cast<size_t>(axis)], plane / 256);
      }
    }
  }
}

}  // namespace
}  // namespace voxeld
