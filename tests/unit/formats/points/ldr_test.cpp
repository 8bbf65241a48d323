// LDraw's models, read by what the specification says, against the voxels of the grids.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <limits>
#include <map>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "server/formats/formats.h"
#include "server/formats/points/ldr.h"
#include "server/formats/points/ldraw_colors.h"
#include "server/grid/color/oklab.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

using test::to;
using LdrCell = std::array<int, 3>;

std::string ldr_text(const Grid& grid, const OutputOptions& options) {
  const auto bytes = encode(grid, options);
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message());
  return bytes ? std::string(bytes->begin(), bytes->end()) : "";
}

struct LdrFile {
  std::vector<std::string> header;
  std::map<LdrCell, std::string> colors;  // of the cells
  size_t bricks = 0, steps = 0;
};

int ldr_studs(const std::string& part) {
  const std::map<std::string, int> studs = {{"3005.dat", 1}, {"3004.dat", 2}, {"3622.dat", 3},
                                            {"3010.dat", 4}, {"3009.dat", 6}, {"3008.dat", 8}};
  EXPECT_TRUE(studs.contains(part)) << part;
  return studs.contains(part) ? studs.at(part) : 1;
}

// Adds the cells of a brick: 20 by 24 by 20 units for a stud, from its place down.
void add_ldr_brick(std::istringstream& line, LdrFile& file) {
  std::string color, part;
  std::array<int, 3> place{};
  std::array<int, 9> matrix{};
  line >> color;
  for (int& number : place) line >> number;
  for (int& number : matrix) line >> number;
  line >> part;
  ASSERT_TRUE(line) << part;
  const bool is_turned = matrix == std::array{0, 0, 1, 0, 1, 0, -1, 0, 0};
  ASSERT_TRUE(is_turned || (matrix == std::array{1, 0, 0, 0, 1, 0, 0, 0, 1}));
  const int studs = ldr_studs(part);
  ++file.bricks;
  ASSERT_EQ(place[1] % 24, 0);
  for (int i = 0; i < studs; ++i) {
    const int along = 20 * i - 10 * studs + 10;
    const int x = place[0] + (is_turned ? 0 : along), z = -(place[2] + (is_turned ? along : 0));
    ASSERT_EQ((x - 10) % 20, 0);
    ASSERT_EQ((z - 10) % 20, 0);
    const LdrCell cell = {(x - 10) / 20, -place[1] / 24 - 1, (z - 10) / 20};
    EXPECT_EQ(is_turned, cell[1] % 2 == 1);
    EXPECT_TRUE(file.colors.emplace(cell, color).second) << "bricks overlap";
  }
}

LdrFile read_ldr(const std::string& text) {
  LdrFile file;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    EXPECT_TRUE(line.ends_with('\r'));
    line.pop_back();
    std::istringstream words(line);
    int type = -1;
    words >> type;
    if (type == 1) {
      add_ldr_brick(words, file);
    } else if (line == "0 STEP") {
      ++file.steps;
    } else {
      EXPECT_EQ(type, 0);
      EXPECT_EQ(file.bricks, 0U);
      file.header.push_back(line);
    }
  }
  return file;
}

std::string nearest_ldr_code(const std::array<uint8_t, 4>& color) {
  const Lab lab = oklab({color[0], color[1], color[2]});
  double least = std::numeric_limits<double>::max();
  uint32_t code = 0;
  for (const ldraw::LdrawColor& entry : ldraw::ldraw_colors()) {
    const Lab other = oklab(entry.srgb);
    double sum = 0;
    for (size_t c = 0; c < 3; ++c) sum += (lab[c] - other[c]) * (lab[c] - other[c]);
    if (sum < least) {
      least = sum;
      code = entry.code;
    }
  }
  return std::to_string(code);
}

TEST(Ldr, bricks_cover_each_voxel_once_in_the_nearest_colour) {
  const ChannelSet channels = channels_of_bits(~uint32_t{0});
  std::mt19937 random(5);
  const std::array<int, 3> dims = {300, 40, 270};
  auto voxels = test::random_voxels(random, dims, 4000);
  const auto box = test::box_voxels({3, 9, 250}, {40, 20, 268});
  voxels.insert(voxels.end(), box.begin(), box.end());
  std::map<LdrCell, std::string> expected;
  for (const auto& voxel : voxels) expected.try_emplace(voxel.cell, nearest_ldr_code(voxel.color));
  const LdrFile file = read_ldr(ldr_text(test::grid_of(dims, voxels, channels), to(Format::kLdr)));
  EXPECT_TRUE(file.colors == expected);
  EXPECT_EQ(file.steps, 40U);
}

TEST(Ldr, rows_of_one_colour_become_long_bricks_that_cross_those_of_the_next_layer) {
  Grid grid = test::grid_of({23, 2, 11}, test::box_voxels({0, 0, 0}, {23, 2, 11}), ChannelSet{});
  const std::string text = ldr_text(grid, to(Format::kLdr));
  const LdrFile file = read_ldr(text);
  EXPECT_EQ(file.colors.size(), 23U * 2 * 11);
  for (const auto& [cell, color] : file.colors) EXPECT_EQ(color, "71");
  // 23 = 8 + 8 + 4 + 3, 11 = 8 + 3
  EXPECT_EQ(file.bricks, 4U * 11 + 2U * 23);
  EXPECT_EQ(file.steps, 2U);
}

TEST(Ldr, pinned_text) {
  Grid grid = test::grid_of({4, 2, 2},
                            {{.cell = {0, 0, 0}, .color = {0xb4, 0, 0, 255}},
                             {.cell = {1, 0, 0}, .color = {0xb4, 0, 0, 255}},
                             {.cell = {3, 0, 0}, .color = {0xb4, 0, 0, 255}},
                             {.cell = {2, 1, 0}, .color = {0x1e, 0x5a, 0xa8, 255}},
                             {.cell = {2, 1, 1}, .color = {0x1e, 0x5a, 0xa8, 255}}},
                            ChannelSet{.color = true});
  const std::string header =
      "0 Voxels as bricks\r\n0 Name: voxels.ldr\r\n0 Author: voxeld\r\n"
      "0 !LDRAW_ORG Unofficial_Model\r\n0 // dims 4 2 2\r\n"
      "0 // origin -1.5 0.25 1e+10\r\n0 // voxel_size 0.5 0.25 0.125\r\n0 // units mm\r\n";
  EXPECT_EQ(ldr_text(grid, to(Format::kLdr)), header +
                                                  "0 // voxels 5\r\n"
                                                  "1 4 20 -24 -10 1 0 0 0 1 0 0 0 1 3004.dat\r\n"
                                                  "1 4 70 -24 -10 1 0 0 0 1 0 0 0 1 3005.dat\r\n"
                                                  "0 STEP\r\n"
                                                  "1 1 50 -48 -20 0 0 1 0 1 0 -1 0 0 3004.dat\r\n"
                                                  "0 STEP\r\n");
  grid.tiles.clear();
  EXPECT_EQ(ldr_text(grid, to(Format::kLdr)), header + "0 // voxels 0\r\n");
}

TEST(Ldr, colours_of_a_palette_and_of_ids_are_direct) {
  Grid grid = test::grid_of({12, 12, 12},
                            {{.cell = {0, 0, 0}, .color = {250, 2, 3, 255}, .label = 1},
                             {.cell = {2, 0, 0}, .color = {1, 2, 240, 255}, .label = 2}},
                            ChannelSet{.color = true, .label = true});
  OutputOptions options = to(Format::kLdr);
  options.palette = {{255, 0, 0}, {0, 0, 0xfe}};
  EXPECT_EQ(read_ldr(ldr_text(grid, options)).colors,
            (std::map<LdrCell, std::string>{{{0, 0, 0}, "0x2FF0000"}, {{2, 0, 0}, "0x20000FE"}}));
  grid.channels.color = false;
  grid.tiles[0].color.clear();
  const LdrFile file = read_ldr(ldr_text(grid, to(Format::kLdr)));
  const auto direct = [](uint16_t id) {
    std::array<char, 16> text{};
    const auto color = id_color(id);
    std::snprintf(text.data(), text.size(), "0x2%02X%02X%02X", color[0], color[1], color[2]);
    return std::string(text.data());
  };
  EXPECT_EQ(file.colors,
            (std::map<LdrCell, std::string>{{{0, 0, 0}, direct(1)}, {{2, 0, 0}, direct(2)}}));
}

TEST(Ldr, voxels_without_a_colour_have_the_mean_colour) {
  Grid grid = test::grid_of({16, 16, 16},
                            {{.cell = {0, 0, 0}, .color = {200, 10, 10, 255}}, {.cell = {1, 0, 0}}},
                            ChannelSet{.color = true});
  const LdrFile two = read_ldr(ldr_text(grid, to(Format::kLdr)));
  EXPECT_EQ(two.colors, (std::map<LdrCell, std::string>{{{0, 0, 0}, "4"}, {{1, 0, 0}, "4"}}));
  grid = test::grid_with_a_full_brick(true, false);
  const LdrFile file = read_ldr(ldr_text(grid, to(Format::kLdr)));
  EXPECT_EQ(file.colors.size(), 513U);
  EXPECT_EQ(file.colors.at({15, 15, 15}), nearest_ldr_code({10, 20, 30, 255}));
  EXPECT_EQ(file.bricks, 65U);
  EXPECT_TRUE(file.colors.contains({8, 8, 8}));
}

TEST(Ldr, more_voxels_than_bricks_may_be_are_refused) {
  Grid grid;
  grid.spec.dims = {4 * limits::kTileSide + 8, limits::kTileSide, limits::kTileSide};
  for (int x = 0; x < 5; ++x) {
    SparseTile& tile = grid.tiles.emplace_back();
    tile.coord = {x, 0, 0};
    tile.full = {{0, x < 4 ? kTileLevels : 0}};
  }
  EXPECT_EQ(encode(grid, to(Format::kLdr)).error().message(),
            "ldr: too many voxels for bricks: expected at most 67108864, got 67109376");
}

TEST(Ldr, voxels_of_other_proportions_than_bricks_give_a_warning) {
  GridSpec spec;
  spec.voxel_size = {0.05, 0.06, 0.05};
  EXPECT_TRUE(ldraw::brick_warnings(spec).empty());
  spec.voxel_size = glm::dvec3(0.05);
  const auto warnings = ldraw::brick_warnings(spec);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_EQ(warnings[0].code, "brick-proportions");
  EXPECT_EQ(warnings[0].detail,
            "ldr: bricks are 1 x 1.2 x 1, voxels of this grid 0.05 x 0.05 x 0.05, so the model is "
            "stretched");
}

}  // namespace
}  // namespace voxeld
