// OctoMap's trees, read by what its source says, against the cells of the grids.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <string>
#include <vector>

#include "server/formats/formats.h"
#include "server/formats/octomap.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

using test::to;
using Bytes = std::vector<uint8_t>;
using OctoCell = std::array<int64_t, 3>;

struct BtLeaf {
  OctoCell key;  // of its first cell
  int64_t side;  // in cells
};

struct BtFile {
  std::vector<std::string> comments;
  uint64_t size = 0;
  double resolution = 0;
  uint64_t nodes = 0;
  std::vector<BtLeaf> leaves;
};

constexpr int64_t kBtRootSide = 65536, kBtMiddle = 32768;

class BtReader {
 public:
  explicit BtReader(const Bytes& bytes) : bytes_(bytes) {}

  BtFile read() {
    EXPECT_EQ(line(), "# Octomap OcTree binary file");
    bool has_id = false;
    for (std::string text = line(); text != "data"; text = line()) {
      if (text.empty()) break;
      if (text.starts_with("#")) {
        file_.comments.push_back(text);
      } else if (text.starts_with("size ")) {
        file_.size = std::stoull(text.substr(5));
      } else if (text.starts_with("res ")) {
        file_.resolution = std::stod(text.substr(4));
      } else {
        EXPECT_EQ(text, "id OcTree");
        has_id = true;
      }
    }
    EXPECT_TRUE(has_id);
    if (file_.size > 0) read_inner({0, 0, 0}, kBtRootSide);
    EXPECT_EQ(at_, bytes_.size());
    EXPECT_EQ(file_.nodes, file_.size);
    return std::move(file_);
  }

 private:
  std::string line() {
    std::string text;
    while (at_ < bytes_.size() && bytes_[at_] != '\n') text += static_cast<char>(bytes_[at_++]);
    ++at_;
    return text;
  }

  void read_inner(const OctoCell& key, int64_t side) {
    ASSERT_GT(side, 1);
    ASSERT_LE(at_ + 2, bytes_.size());
    const unsigned bits = bytes_[at_] | unsigned{bytes_[at_ + 1]} << 8;
    at_ += 2;
    ++file_.nodes;
    EXPECT_NE(bits, 0U) << "an inner node without children";
    EXPECT_NE(bits, 0xaaaaU) << "not pruned";
    for (unsigned child = 0; child < 8; ++child) {
      const int64_t half = side / 2;
      const OctoCell first = {key[0] + half * (child & 1), key[1] + half * (child >> 1 & 1),
                              key[2] + half * (child >> 2)};
      const unsigned state = bits >> (2 * child) & 3;
      ASSERT_NE(state, 1U) << "free";
      if (state == 2) {
        ++file_.nodes;
        file_.leaves.push_back({first, half});
      }
      if (state == 3) read_inner(first, half);
      if (testing::Test::HasFatalFailure()) return;
    }
  }

  const Bytes& bytes_;
  size_t at_ = 0;
  BtFile file_;
};

BtFile read_bt(const Grid& grid) {
  const auto bytes = encode(grid, to(Format::kBt));
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message());
  return bytes ? BtReader(*bytes).read() : BtFile();
}

using OctoCells = std::vector<OctoCell>;  // sorted

// The cells of the leaves less `first`: that of the grid's cell (0,0,0).
OctoCells octomap_cells(const BtFile& file, const OctoCell& first) {
  OctoCells cells;
  for (const BtLeaf& leaf : file.leaves) {
    for (int64_t z = 0; z < leaf.side; ++z) {
      for (int64_t y = 0; y < leaf.side; ++y) {
        for (int64_t x = 0; x < leaf.side; ++x) {
          cells.push_back({x + leaf.key[0] - kBtMiddle - first[0],
                           y + leaf.key[1] - kBtMiddle - first[1],
                           z + leaf.key[2] - kBtMiddle - first[2]});
        }
      }
    }
  }
  std::ranges::sort(cells);
  EXPECT_EQ(std::ranges::adjacent_find(cells), cells.end()) << "leaves overlap";
  return cells;
}

OctoCells octomap_cells(const Grid& grid) {
  OctoCells cells;
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t) { cells.push_back({x, y, z}); });
  }
  std::ranges::sort(cells);
  return cells;
}

Grid octomap_grid_at(Grid grid, const glm::dvec3& origin, double size) {
  grid.spec.origin_world = origin;
  grid.spec.voxel_size = glm::dvec3(size);
  return grid;
}

TEST(Octomap, has_each_voxel_at_its_place_and_the_offset) {
  const ChannelSet channels = channels_of_bits(~uint32_t{0});
  std::mt19937 random(3);
  const Grid grid = octomap_grid_at(
      test::grid_of({70, 300, 33}, test::random_voxels(random, {70, 300, 33}, 3000), channels),
      {-1.5, 0.2, 3}, 0.5);
  const BtFile file = read_bt(grid);
  EXPECT_EQ(file.resolution, 0.5);
  EXPECT_TRUE(octomap_cells(file, {-3, 0, 6}) == octomap_cells(grid));
  EXPECT_EQ(file.comments, (std::vector<std::string>{
                               "# voxeld, world = position in this file + offset",
                               "# dims 70 300 33", "# origin -1.5 0.2 3",
                               "# voxel_size 0.5 0.5 0.5", "# units mm", "# offset 0 0.2 0"}));
}

TEST(Octomap, full_nodes_of_any_shift_are_leaves_as_large_as_can_be) {
  std::mt19937 random(8);
  size_t cells = 0;
  for (int round = 0; round < 8; ++round) {
    Grid grid;
    grid.spec.dims = {512, 256, 256};
    for (const int x : {0, 1}) {
      SparseTile tile = test::tile_with_full_nodes(random, round % 2 == 0, false);
      if (round % 3 == 0) tile.full.clear();
      // The largest nodes have more cells than a test should compare one by one.
      std::erase_if(tile.full, [](const FullNode& node) { return node.level > 2; });
      tile.coord = {x, 0, 0};
      grid.tiles.push_back(std::move(tile));
    }
    grid.channels.color = round % 2 == 0;
    const auto shift = [&] { return round < 2 ? 0 : test::below(random, 700) - 350; };
    const OctoCell first = {shift(), shift(), shift()};
    grid = octomap_grid_at(grid, glm::dvec3(first[0], first[1], first[2]) * 0.25, 0.25);
    const OctoCells wanted = octomap_cells(grid);
    EXPECT_TRUE(octomap_cells(read_bt(grid), first) == wanted) << round;
    EXPECT_TRUE(octomap::lattice_warnings(grid.spec).empty());
    cells += wanted.size();
  }
  EXPECT_GT(cells, 100'000u);
}

TEST(Octomap, the_inside_of_the_largest_solid_costs_nothing) {
  Grid grid;
  const int side = limits::kGridSideMax / limits::kTileSide;
  grid.spec.dims = glm::ivec3(limits::kGridSideMax);
  for (int z = 0; z < side; ++z) {
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        SparseTile& tile = grid.tiles.emplace_back();
        tile.coord = {x, y, z};
        tile.full = {{0, kTileLevels}};
      }
    }
  }
  normalize_tiles(grid);
  const BtFile file = read_bt(octomap_grid_at(grid, {0, 0, 0}, 1));
  ASSERT_EQ(file.leaves.size(), 1U);
  EXPECT_EQ(file.leaves[0].key, (OctoCell{kBtMiddle, kBtMiddle, kBtMiddle}));
  EXPECT_EQ(file.leaves[0].side, limits::kGridSideMax);
  EXPECT_EQ(file.size, 3U);  // two inner nodes above it
}

TEST(Octomap, a_grid_without_voxels_has_no_nodes) {
  Grid grid;
  grid.spec.dims = {3, 2, 1};
  const auto bytes = encode(grid, to(Format::kBt));
  ASSERT_TRUE(bytes);
  EXPECT_EQ(std::string(bytes->begin(), bytes->end()),
            "# Octomap OcTree binary file\n# voxeld, world = position in this file + offset\n"
            "# dims 3 2 1\n# origin 0 0 0\n# voxel_size 1 1 1\n# offset 0 0 0\n"
            "id OcTree\nsize 0\nres 1\ndata\n");
}

TEST(Octomap, pinned_bytes_of_two_voxels) {
  const Grid grid = octomap_grid_at(
      test::grid_of({2, 1, 1}, {{.cell = {0, 0, 0}}, {.cell = {1, 0, 0}}}, ChannelSet{}),
      {0, 0, -1}, 1);
  const auto bytes = encode(grid, to(Format::kBt));
  ASSERT_TRUE(bytes);
  // The root's child 3, then 14 nodes with child 4 at the lattice's middle, and two leaves.
  Bytes expected = {0xc0, 0x00};
  for (int i = 0; i < 14; ++i) expected.insert(expected.end(), {0x00, 0x03});
  expected.insert(expected.end(), {0x00, 0x0a});
  EXPECT_EQ(Bytes(bytes->end() - 32, bytes->end()), expected);
}

TEST(Octomap, axes_that_do_not_fit_the_lattice_begin_at_0) {
  const Grid grid = octomap_grid_at(
      test::grid_of({8, 8, 8}, {{.cell = {1, 2, 3}}, {.cell = {7, 7, 7}}}, ChannelSet{}),
      {500000.25, -3276.8, 3276.7}, 0.1);
  const octomap::LatticePlace place = octomap::lattice_place(grid.spec);
  EXPECT_EQ(place.first_cell, glm::ivec3(0, -32768, 0));
  EXPECT_EQ(place.offset, glm::dvec3(500000.25, 0, 3276.7));
  EXPECT_TRUE(octomap_cells(read_bt(grid), {0, -32768, 0}) == octomap_cells(grid));
  const std::vector<Warning> warnings = octomap::lattice_warnings(grid.spec);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_EQ(warnings[0].code, "moved");
  EXPECT_EQ(warnings[0].detail,
            "bt: positions are multiples of the voxel size, up to 32768 voxels from the origin; "
            "add 500000.25 0 3276.7 to those of the file");
}

TEST(Octomap, voxels_that_are_no_cubes_become_cubes_of_the_size_of_x) {
  Grid grid = test::grid_of({8, 8, 8}, {{.cell = {1, 2, 3}}, {.cell = {7, 7, 7}}}, ChannelSet{});
  const BtFile file = read_bt(grid);  // of origin -1.5, 0.25, 1e10 and size 0.5, 0.25, 0.125
  EXPECT_EQ(file.resolution, 0.5);
  EXPECT_TRUE(octomap_cells(file, {-3, 1, 0}) == octomap_cells(grid));
  EXPECT_EQ(octomap::lattice_place(grid.spec).offset, glm::dvec3(0, -0.25, 1e10));
}

}  // namespace
}  // namespace voxeld
