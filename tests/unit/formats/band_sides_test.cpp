// Which side cells beside a band are on, in levels and parts of it, against the sphere itself.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "server/formats/formats.h"
#include "server/grid/region.h"
#include "tests/unit/formats/npy/npy_reader.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

constexpr int kBandDims = 90;
constexpr double kBallRadius = 31.7;
constexpr glm::dvec3 kBallCenters[] = {{45, 45, 45}, {44.3, 46.9, 41.2}, {40.5, 47.75, 45.1}};

double ball_distance(const glm::dvec3& center, const glm::dvec3& point) {
  return glm::length(point - center) - kBallRadius;
}

Grid band_of_ball(const glm::dvec3& center, double thickness) {
  std::vector<test::TestVoxel> voxels;
  for (int z = 0; z < kBandDims; ++z) {
    for (int y = 0; y < kBandDims; ++y) {
      for (int x = 0; x < kBandDims; ++x) {
        const double distance = ball_distance(center, {x + 0.5, y + 0.5, z + 0.5});
        if (std::abs(distance) > thickness) continue;
        const auto steps = static_cast<int16_t>(std::lround(128 * distance));
        const int16_t signed_steps = distance < 0 ? int16_t{-1} : int16_t{1};
        voxels.push_back({.cell = {x, y, z}, .distance = steps == 0 ? signed_steps : steps});
      }
    }
  }
  Grid grid = test::grid_of({kBandDims, kBandDims, kBandDims}, voxels, {.distance = true});
  grid.spec.origin_world = {};
  grid.spec.voxel_size = glm::dvec3(1);
  grid.meta = GridMeta({{"options", {{"fill", "band"}, {"thickness", thickness}}}, {"units", "m"}});
  return grid;
}

Grid selected(const Grid& whole, const OutputOptions& options) {
  const GridTiles source(whole);
  const auto selection = Selection::open(source, options);
  EXPECT_TRUE(selection) << selection.error().message();
  Grid grid = selection->tiles().grid();
  EXPECT_TRUE(for_each_batch(selection->tiles(), [&](std::vector<SparseTile> tiles) -> Status {
                for (SparseTile& tile : tiles) grid.tiles.push_back(std::move(tile));
                return {};
              }).ok());
  return grid;
}

// The cells of a dense array by what it says of those without a voxel.
struct Sides {
  int right = 0, wrong = 0, unknown = 0;
  int inside = 0;  // of the right ones
};

Sides sides_of(const Grid& grid, const glm::dvec3& center) {
  const auto floats = [&](std::optional<Channel> channel) {
    OutputOptions options;
    options.dtype = DType::kFloat32;
    const std::vector<uint8_t> data = test::read_npy(test::npy_of(grid, channel, options)).data;
    std::vector<float> values(data.size() / sizeof(float));
    std::memcpy(values.data(), data.data(), data.size());
    return values;
  };
  const std::vector<float> occupied = floats(std::nullopt), distances = floats(Channel::kDistance);
  Sides sides;
  size_t at = 0;
  for (int z = 0; z < grid.spec.dims.z; ++z) {
    for (int y = 0; y < grid.spec.dims.y; ++y) {
      for (int x = 0; x < grid.spec.dims.x; ++x, ++at) {
        if (occupied[at] != 0) continue;
        const double exact =
            ball_distance(center, grid.spec.world_from_grid({x + 0.5, y + 0.5, z + 0.5}));
        if (std::isnan(distances[at])) {
          ++sides.unknown;
        } else if (std::signbit(distances[at]) == std::signbit(exact)) {
          ++sides.right;
          sides.inside += exact < 0 ? 1 : 0;
        } else {
          ++sides.wrong;
        }
      }
    }
  }
  return sides;
}

TEST(BandSides, of_a_level_are_right_or_unknown) {
  for (const glm::dvec3& center : kBallCenters) {
    for (const double thickness : {2.0, 3.0, 4.0, 6.0}) {
      const Grid whole = band_of_ball(center, thickness);
      for (int level = 0; level <= 4; ++level) {
        for (const LevelRule rule : {LevelRule::kAny, LevelRule::kMajority}) {
          OutputOptions options;
          options.level = level;
          options.level_rule = rule;
          // The whole edge of 90 cells is a multiple of 2 alone.
          const double share = rule == LevelRule::kAny ? 4.0 / 3 : level == 1 ? 2.0 / 3 : 0;
          const bool is_known = level == 0 || std::ldexp(1.0, level) <= share * thickness;
          const Sides sides = sides_of(selected(whole, options), center);
          SCOPED_TRACE("thickness " + std::to_string(thickness) + ", level " +
                       std::to_string(level));
          EXPECT_EQ(sides.wrong, 0);
          EXPECT_EQ(sides.unknown > 0, !is_known);
          EXPECT_EQ(sides.right > 0, is_known);
          EXPECT_EQ(sides.inside > 0, is_known);
        }
      }
    }
  }
}

TEST(BandSides, of_a_level_of_a_level_are_those_of_the_coarser_one) {
  const Grid whole = band_of_ball(kBallCenters[1], 3);
  OutputOptions one;
  one.level = 1;
  const Grid half = selected(whole, one);
  const Grid quarter = selected(half, one);
  for (const Grid* grid : {&half, &quarter}) {
    const Sides sides = sides_of(*grid, kBallCenters[1]);
    EXPECT_EQ(sides.wrong + sides.unknown, 0);
    EXPECT_GT(sides.inside, 0);
  }
  const Sides eighth = sides_of(selected(quarter, one), kBallCenters[1]);
  EXPECT_EQ(eighth.right + eighth.wrong, 0);
}

TEST(BandSides, of_a_region_are_right_and_unknown_where_it_has_no_voxel) {
  const Grid whole = band_of_ball(kBallCenters[2], 3);
  using Region = std::array<int, 6>;
  // Through the ball, its top, a corner inside of it that has a little of the band.
  for (const Region& region : {Region{40, 0, 10, 47, 90, 90}, Region{30, 70, 30, 50, 90, 60},
                               Region{30, 40, 40, 45, 75, 45}, Region{38, 46, 43, 75, 48, 46}}) {
    OutputOptions options;
    options.region = region;
    const Sides sides = sides_of(selected(whole, options), kBallCenters[2]);
    EXPECT_GT(sides.right, 0);
    EXPECT_EQ(sides.wrong + sides.unknown, 0) << region[0];
  }
  // Inside alone, and outside.
  for (const Region& region : {Region{38, 46, 43, 44, 50, 47}, Region{0, 0, 0, 9, 9, 9}}) {
    OutputOptions options;
    options.region = region;
    const Sides sides = sides_of(selected(whole, options), kBallCenters[2]);
    EXPECT_GT(sides.unknown, 0);
    EXPECT_EQ(sides.right + sides.wrong, 0) << region[0];
  }
}

TEST(BandSides, are_unknown_once_voxels_of_the_band_are_gone) {
  const Grid whole = band_of_ball(kBallCenters[0], 4);
  for (int OutputOptions::*const steps : {&OutputOptions::hollow, &OutputOptions::erode}) {
    OutputOptions options;
    options.*steps = 1;
    const Sides sides = sides_of(selected(whole, options), kBallCenters[0]);
    EXPECT_GT(sides.unknown, 0);
    EXPECT_EQ(sides.right + sides.wrong, 0);
  }
}

}  // namespace
}  // namespace voxeld
