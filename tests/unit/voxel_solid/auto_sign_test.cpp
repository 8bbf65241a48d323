// sign=auto of meshes that do not close, and the regions by which it decides.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <optional>
#include <random>
#include <vector>

#include "server/voxel/solid/inside_cells.h"
#include "server/voxel/solid/regions.h"
#include "tests/bench/waves.h"
#include "tests/unit/voxel_solid/solid_scenes.h"

namespace voxeld {
namespace {

using namespace solid_test;

// A closed mesh of radius 1.
constexpr int kLevel = 3;

VoxelizeOptions of_size(Sign sign, int size) {
  VoxelizeOptions options = solid(sign);
  options.placement.size = size;
  return options;
}

// The mesh as loose triangles, of which those that `flips` chooses face the other way.
Scene flipped(const Scene& scene, const std::function<bool()>& flips) {
  auto triangles = triangles_of(scene);
  for (auto& triangle : triangles) {
    if (flips()) std::swap(triangle[1], triangle[2]);
  }
  return scene_of(triangles);
}

std::function<bool()> half_of(unsigned seed) {
  return [random = std::mt19937(seed)]() mutable { return random() % 2 == 0; };
}

// Every corner of every triangle is moved by up to `distance` along each axis, so that no two
// triangles have an edge in common.
Scene cracked(const Scene& scene, double distance, unsigned seed) {
  auto triangles = triangles_of(scene);
  std::mt19937 random(seed);
  for (auto& triangle : triangles) {
    for (auto& corner : triangle) {
      for (double& x : corner) x += distance * (static_cast<double>(random()) / 2147483648.0 - 1.0);
    }
  }
  return scene_of(triangles);
}

// The cells of `a` and `b` that differ and that neither surface touches.
size_t differences_beside(const Grid& a, const Grid& b, const std::vector<const Scene*>& scenes) {
  const OracleGrid place = oracle_grid(a);
  Occupancy touched(cells_of(a).size());
  for (const Scene* scene : scenes) {
    const Occupancy one = reference::touched_cells(triangles_of(*scene), place);
    for (size_t i = 0; i < touched.size(); ++i) touched[i] |= one[i];
  }
  const Occupancy cells_a = cells_of(a), cells_b = cells_of(b);
  size_t count = 0;
  for (size_t i = 0; i < touched.size(); ++i) {
    count += touched[i] == 0 && cells_a[i] != cells_b[i] ? 1 : 0;
  }
  return count;
}

TEST(AutoSign, is_the_same_for_any_winding) {
  const Scene sphere = wavy_sphere(kLevel);
  for (const int size : {17, 64, 270}) {
    const Grid expected = voxelized(sphere, of_size(Sign::kAuto, size));
    const Grid inward = voxelized(flipped(sphere, [] { return true; }), of_size(Sign::kAuto, size));
    EXPECT_TRUE(inward.tiles == expected.tiles) << size;
    const Scene random = flipped(sphere, half_of(1));
    VoxelizeStats stats;
    EXPECT_TRUE(voxelized(random, of_size(Sign::kAuto, size), &stats).tiles == expected.tiles)
        << size;
    EXPECT_GT(stats.fill->boundary_edges, 100);
    EXPECT_EQ(stats.fill->ambiguous_fraction, 0.0);
  }
}

TEST(AutoSign, cracks_narrower_than_a_cell_do_not_show) {
  // The radius is 40 cells, the box 100.
  const Scene sphere =
      moved(wavy_sphere(kLevel), [](const glm::dvec3& p) { return 30.0 * p + 50.0; });
  VoxelizeOptions options = solid(Sign::kAuto);
  set_bounds(options, glm::dvec3(0), glm::dvec3(100));
  const Grid whole = voxelized(sphere, options);
  for (const unsigned seed : {1u, 2u, 3u}) {
    for (const bool is_random : {false, true}) {
      Scene open = cracked(sphere, 0.03, seed);
      if (is_random) open = flipped(open, half_of(seed));
      // The few that differ, of 200,000, are pockets of one cell between touched ones: no neighbour
      // tells their state.
      EXPECT_LE(differences_beside(voxelized(open, options), whole, {&open, &sphere}), 5u)
          << "seed " << seed << (is_random ? ", random" : "");
      options.sign = Sign::kMajority;
      EXPECT_GT(differences_beside(voxelized(open, options), whole, {&open, &sphere}), 0u)
          << "there are cracks";
      options.sign = Sign::kAuto;
    }
  }
}

TEST(AutoSign, a_wall_stays_a_wall_and_a_cavity_a_cavity) {
  const Scene shell =
      joined(box(glm::dvec3(4), glm::dvec3(60)), box(glm::dvec3(20.3), glm::dvec3(40.3)));
  VoxelizeOptions options = solid(Sign::kAuto);
  set_bounds(options, glm::dvec3(0), glm::dvec3(64));
  const Grid grid = voxelized(flipped(shell, half_of(5)), options);
  EXPECT_EQ(grid.voxel_count(), 56u * 56 * 56 - 20u * 20 * 20);
}

// A third of the sphere is missing.
Scene bowl() {
  return without(wavy_sphere(kLevel), [](const glm::dvec3& c) { return c.z > 0.3; });
}

// Cells that the winding number of the oracle decides by this much.
constexpr long double kClear = 0.05L;

TEST(AutoSign, winding_numbers_decide_where_the_mesh_is_open) {
  const Scene open = bowl();
  VoxelizeStats stats;
  const Grid grid = voxelized(open, of_size(Sign::kAuto, 33), &stats);
  EXPECT_NE(stats.fill->reason.find("winding where the axes disagree"), std::string::npos);
  EXPECT_GT(*stats.fill->ambiguous_fraction, 0.01);
  const OracleGrid place = oracle_grid(grid);
  const auto snapped = reference::snap_triangles(triangles_of(open), place);
  std::array<Occupancy, 3> parities;
  for (int axis = 0; axis < 3; ++axis) {
    parities[static_cast<size_t>(axis)] = reference::parity_cells(snapped, place, axis);
  }
  const Occupancy cells = cells_of(grid);
  size_t doubtful = 0, wrong = 0, i = 0;
  for (int z = 0; z < place.dims[2]; ++z) {
    for (int y = 0; y < place.dims[1]; ++y) {
      for (int x = 0; x < place.dims[0]; ++x, ++i) {
        const int votes = parities[0][i] + parities[1][i] + parities[2][i];
        if (votes == 0 || votes == 3) {
          EXPECT_EQ(cells[i] != 0, votes == 3);
          continue;
        }
        ++doubtful;
        const long double winding = reference::winding_number(snapped, {x, y, z});
        if (std::abs(winding - 0.5L) < kClear) continue;
        wrong += (winding > 0.5L) != (cells[i] != 0) ? 1 : 0;
      }
    }
  }
  EXPECT_GT(doubtful, 500u);
  EXPECT_EQ(wrong, 0u);
}

TEST(AutoSign, an_open_mesh_may_face_inwards_as_well) {
  const Scene open = bowl();
  for (const int size : {33, 270}) {
    const Grid outward = voxelized(open, of_size(Sign::kAuto, size));
    const Grid inward = voxelized(flipped(open, [] { return true; }), of_size(Sign::kAuto, size));
    EXPECT_TRUE(inward.tiles == outward.tiles) << size;
  }
}

TEST(AutoSign, without_a_common_orientation_winding_numbers_mean_nothing) {
  const Scene open = flipped(bowl(), half_of(3));
  VoxelizeStats stats;
  const Grid grid = voxelized(open, of_size(Sign::kAuto, 60), &stats);
  EXPECT_NE(stats.fill->reason.find("majority where the axes disagree"), std::string::npos);
  // A few doubtful cells beside many certain ones take their state; the others stay as they are.
  const Occupancy majority = cells_of(voxelized(open, of_size(Sign::kMajority, 60)));
  const Occupancy oriented = cells_of(voxelized(bowl(), of_size(Sign::kAuto, 60)));
  const Occupancy cells = cells_of(grid);
  EXPECT_GT(reference::count(cells), 10000u);
  EXPECT_LT(differences(cells, majority), reference::count(cells) / 20);
  EXPECT_LT(differences(cells, oriented), reference::count(cells) / 20);
}

TEST(AutoSign, does_not_depend_on_threads_or_on_the_order_of_triangles) {
  auto triangles = triangles_of(cracked(bowl(), 2e-2, 4));
  const VoxelizeOptions options = of_size(Sign::kAuto, 140);
  const Grid one = voxelized(scene_of(triangles), options, nullptr, 1);
  std::ranges::shuffle(triangles, std::mt19937(7));
  EXPECT_TRUE(voxelized(scene_of(triangles), options, nullptr, 3).tiles == one.tiles);
}

TEST(AutoSign, the_grid_of_rule_touch_is_that_of_rule_none_and_the_surface) {
  const Scene open = cracked(bowl(), 1e-2, 4);
  VoxelizeOptions options = of_size(Sign::kAuto, 50);
  const Grid inside = voxelized(open, options);
  options.rule = Rule::kTouch;
  const Grid both = voxelized(open, options);
  options.fill = Fill::kSurface;
  Occupancy expected = cells_of(voxelized(open, options));
  const Occupancy inner = cells_of(inside);
  for (size_t i = 0; i < expected.size(); ++i) expected[i] |= inner[i];
  EXPECT_EQ(differences(cells_of(both), expected), 0u);
}

TEST(AutoSign, coverage_of_cells_that_no_triangle_touches_is_all_or_none) {
  const Scene sphere = wavy_sphere(kLevel);
  const Scene open = flipped(cracked(sphere, 2e-3, 9), half_of(2));
  VoxelizeOptions options = of_size(Sign::kAuto, 60);
  options.rule = Rule::kTouch;
  options.channels = ChannelSet{.coverage = true};
  const Grid grid = voxelized(open, options);
  const Occupancy touched = reference::touched_cells(triangles_of(open), oracle_grid(grid));
  size_t whole = 0;
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      const auto& dims = grid.spec.dims;
      if (voxel == kNoAttributes || touched[static_cast<size_t>((z * dims.y + y) * dims.x + x)]) {
        return;
      }
      EXPECT_EQ(tile.coverage[voxel], 255);
      ++whole;
    });
  }
  EXPECT_GT(whole, 1000u);
}

TEST(AutoSign, a_cancel_ends_it) {
  const Scene open = cracked(bowl(), 2e-2, 4);
  const VoxelizeOptions options = of_size(Sign::kAuto, 100);
  Voxelizer voxelizer(nullptr, 2);
  int calls = 0;
  const auto count = [&](int64_t, int64_t) {
    ++calls;
    return true;
  };
  ASSERT_TRUE(voxelizer.voxelize(open, options, count, nullptr).ok());
  const int all = calls;
  EXPECT_GT(all, 20) << "it asks between its steps";
  for (const int last : {all - 1, all / 2}) {
    calls = 0;
    const auto grid = voxelizer.voxelize(
        open, options, [&](int64_t, int64_t) { return ++calls < last; }, nullptr);
    ASSERT_FALSE(grid.ok());
    EXPECT_EQ(grid.error().code, ErrorCode::kCancelled);
    EXPECT_EQ(calls, last);
  }
}

// Two of three cells of a box of cells, more or less, on two tiles of each axis.
struct Maze {
  static constexpr glm::ivec3 kFirst{244, 245, 246}, kSize{23, 21, 19};

  explicit Maze(unsigned seed) {
    std::mt19937 random(seed);
    std::array<std::vector<BrickMask>, 8> bricks;
    for (auto& of_tile : bricks) of_tile.resize(kTileBrickCount);
    walls.resize(static_cast<size_t>(kSize.x * kSize.y * kSize.z));
    for (size_t i = 0; i < walls.size(); ++i) {
      const glm::ivec3 at = kFirst + cell(i);
      walls[i] = random() % 16 < 11 ? 1 : 0;
      if (walls[i] == 0) continue;
      const glm::ivec3 tile = at / limits::kTileSide, in_tile = at % limits::kTileSide;
      const glm::uvec3 brick(in_tile / 8), in_brick(in_tile % 8);
      const uint32_t bit = morton_encode(in_brick.x, in_brick.y, in_brick.z);
      bricks[static_cast<size_t>(tile.x + 2 * tile.y + 4 * tile.z)]
            [morton_encode(brick.x, brick.y, brick.z)]
                .words[bit / 64] |= uint64_t{1} << (bit % 64);
    }
    for (int t = 0; t < 8; ++t) {
      SparseTile& tile = tiles.emplace_back();
      tile.coord = {t % 2, t / 2 % 2, t / 4};
      for (uint32_t morton = 0; morton < kTileBrickCount; ++morton) {
        const BrickMask& mask = bricks[static_cast<size_t>(t)][morton];
        if (mask == BrickMask{}) continue;
        tile.brick_morton.push_back(morton);
        tile.masks.push_back(mask);
      }
    }
  }

  static glm::ivec3 cell(size_t i) {
    const auto at = static_cast<int>(i);
    return {at % kSize.x, at / kSize.x % kSize.y, at / kSize.x / kSize.y};
  }
  static std::optional<size_t> index(const glm::ivec3& at) {
    for (int axis = 0; axis < 3; ++axis) {
      if (at[axis] < 0 || at[axis] >= kSize[axis]) return std::nullopt;
    }
    return static_cast<size_t>((at.z * kSize.y + at.y) * kSize.x + at.x);
  }

  // Numbers of regions by a search from cell to cell; 0: reaches the outside; -1: a wall.
  std::vector<int> regions() const {
    std::vector<int> number(walls.size(), -2);
    for (size_t i = 0; i < walls.size(); ++i) {
      if (walls[i] != 0) number[i] = -1;
    }
    int next = 1;
    for (size_t first = 0; first < walls.size(); ++first) {
      if (number[first] != -2) continue;
      std::vector<size_t> found = {first};
      number[first] = next;
      bool is_outer = false;
      for (size_t i = 0; i < found.size(); ++i) {
        for (const int axis : {0, 1, 2}) {
          for (const int step : {-1, 1}) {
            glm::ivec3 at = cell(found[i]);
            at[axis] += step;
            const auto neighbour = index(at);
            is_outer |= !neighbour;
            if (!neighbour || number[*neighbour] != -2) continue;
            number[*neighbour] = next;
            found.push_back(*neighbour);
          }
        }
      }
      if (is_outer) {
        for (const size_t i : found) number[i] = 0;
      } else {
        ++next;
      }
    }
    return number;
  }

  std::vector<uint8_t> walls;
  std::vector<SparseTile> tiles;
};

// The cells of a region, each as often as it is visited.
std::vector<size_t> visited(Regions& regions, const Regions::Piece& start, Regions::Turn turn) {
  std::vector<size_t> cells;
  const auto visit = [&](const Regions::Piece& piece) {
    const auto brick = morton_decode(static_cast<uint32_t>(piece.brick));
    for (int bit = 0; bit < 512; ++bit) {
      if ((piece.cells[static_cast<size_t>(bit / 64)] >> (bit % 64) & 1) == 0) continue;
      const auto index = Maze::index(piece.tile * limits::kTileSide +
                                     limits::kBrickSide * glm::ivec3(brick[0], brick[1], brick[2]) +
                                     glm::ivec3(bit % 8, bit / 8 % 8, bit / 64) - Maze::kFirst);
      cells.push_back(index.value_or(SIZE_MAX));
    }
  };
  EXPECT_TRUE(regions.flood(start, turn, visit, {}));
  std::ranges::sort(cells);
  return cells;
}

TEST(Regions, are_those_of_a_search_from_cell_to_cell) {
  for (const unsigned seed : {1u, 2u, 3u}) {
    const Maze maze(seed);
    const std::vector<int> expected = maze.regions();
    const int count = std::ranges::max(expected);
    ASSERT_GT(count, 20);
    Regions regions(maze.tiles, glm::ivec3(300));
    ASSERT_TRUE(regions.flood_outside({}));
    int found = 0;
    while (const auto start = regions.next()) {
      ++found;
      const std::vector<size_t> cells = visited(regions, *start, Regions::Turn::kFirst);
      ASSERT_FALSE(cells.empty());
      ASSERT_LT(cells.back(), expected.size());
      std::vector<size_t> wanted;
      for (size_t i = 0; i < expected.size(); ++i) {
        if (expected[i] == expected[cells.front()]) wanted.push_back(i);
      }
      EXPECT_EQ(cells, wanted);
      EXPECT_EQ(visited(regions, *start, Regions::Turn::kSecond), wanted);
    }
    EXPECT_EQ(found, count);
  }
}

// A hollow cube around whole tiles.
TEST(Regions, may_be_whole_tiles) {
  const Scene shell = box(glm::dvec3(200), glm::dvec3(560));
  VoxelizeOptions options;
  set_bounds(options, glm::dvec3(0), glm::dvec3(700));
  const Grid surface = voxelized(shell, options);
  Regions regions(surface.tiles, surface.spec.dims);
  ASSERT_TRUE(regions.flood_outside({}));
  const auto start = regions.next();
  ASSERT_TRUE(start);
  for (const auto turn : {Regions::Turn::kFirst, Regions::Turn::kSecond}) {
    int64_t cells = 0, whole = 0;
    const auto visit = [&](const Regions::Piece& piece) {
      if (piece.brick == Regions::kWholeTile) {
        ++whole;
        cells += int64_t{1} << 24;
        return;
      }
      for (const uint64_t word : piece.cells) cells += std::popcount(word);
    };
    ASSERT_TRUE(regions.flood(*start, turn, visit, {}));
    EXPECT_EQ(cells + static_cast<int64_t>(surface.voxel_count()), 361 * 361 * 361);
    EXPECT_EQ(whole, 1);
  }
  EXPECT_FALSE(regions.next());
}

TEST(InsideCells, change_by_bricks_and_by_tiles) {
  const Regions regions({}, glm::ivec3(600));
  std::vector<SparseTile> tiles(1);
  tiles[0].coord = {1, 0, 0};
  tiles[0].full.push_back({0, kTileLevels});
  InsideCells cells(tiles, regions);
  BrickMask some;
  some.words[3] = 0xf0;
  BrickMask all;
  all.words.fill(~uint64_t{0});
  EXPECT_EQ(cells.brick(1, 77), all);
  EXPECT_EQ(cells.brick(0, 77), BrickMask{});
  EXPECT_EQ(cells.count(1), uint64_t{1} << 24);
  EXPECT_EQ(cells.count(2), 0u);
  cells.change(1, 77, some, false);
  cells.change(0, 9, some, true);
  cells.change(2, 9, some, true);
  cells.change(2, 9, some, false);
  cells.change_tile(3, true);
  cells.finish();
  ASSERT_EQ(tiles.size(), 3u) << "the one without cells is dropped";
  size_t voxels = 0;
  for (SparseTile& tile : tiles) {
    voxels += tile.voxel_count();
    const SparseTile before = tile;
    canonicalize(tile);
    EXPECT_TRUE(tile == before);
  }
  EXPECT_EQ(voxels, (size_t{2} << 24) - 4 + 4);
}

}  // namespace
}  // namespace voxeld
