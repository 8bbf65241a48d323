// NanoVDB files, read back by a reader made from the description of the format.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "server/base/cancel_point.h"
#include "server/formats/formats.h"
#include "server/formats/npy/sample_writers.h"
#include "server/formats/vdb/nano_layout.h"
#include "tests/unit/formats/sample_grid.h"
#include "tests/unit/formats/vdb/nano_reader.h"

namespace voxeld::nvdb_test {  // apart from other tests of a unity build
namespace {

using test::to;
using NanoGrids = std::map<std::string, NanoGrid>;

enum NanoClass : uint32_t { kUnknownClass = 0, kLevelSetClass = 1, kFogClass = 2 };
enum NanoType : uint32_t { kFloatType = 1, kInt32Type = 4, kVec3fType = 6 };

NanoGrids nano_grids(const Grid& grid) {
  const auto bytes = encode(grid, to(Format::kNvdb));
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message());
  return read_nvdb(*bytes);
}

std::vector<std::string> nano_names(const NanoGrids& grids) {
  std::vector<std::string> names;
  for (const auto& [name, grid] : grids) names.push_back(name);
  return names;
}

Value value_of(double x, double y = 0, double z = 0) {
  return {x, y, z};
}

TEST(Nvdb, every_channel_is_a_grid_with_the_voxels_values) {
  std::mt19937 random(3);
  const auto voxels = test::random_voxels(random, {300, 200, 150}, 4000);
  Grid grid = test::grid_of({300, 200, 150}, voxels, channels_of_bits(~uint32_t{0}));
  grid.spec.voxel_size = glm::dvec3(0.25);
  const NanoGrids grids = nano_grids(grid);
  EXPECT_EQ(nano_names(grids), (std::vector<std::string>{"alpha", "color", "density", "label",
                                                         "material", "normal", "surface"}));
  for (const auto& [name, of_name] : grids) {
    EXPECT_EQ(of_name.active_count(), grid.voxel_count()) << name;
  }
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int32_t x, int32_t y, int32_t z, size_t i) {
      const auto is = [&](const char* name, const Value& value) {
        const NanoGrid::Voxel voxel = grids.at(name).voxel({x, y, z});
        EXPECT_TRUE(voxel.is_active) << name;
        EXPECT_EQ(voxel.value, value) << name;
      };
      is("density", value_of(static_cast<float>(tile.coverage[i]) / 255));
      is("surface", value_of(static_cast<float>(tile.distance[i]) / 128 / 4));
      is("color",
         value_of(linear_from_srgb(tile.color[4 * i]), linear_from_srgb(tile.color[4 * i + 1]),
                  linear_from_srgb(tile.color[4 * i + 2])));
      is("alpha", value_of(static_cast<float>(tile.color[4 * i + 3]) / 255));
      is("normal", value_of(static_cast<float>(tile.normal[3 * i]) / 127,
                            static_cast<float>(tile.normal[3 * i + 1]) / 127,
                            static_cast<float>(tile.normal[3 * i + 2]) / 127));
      is("material", value_of(tile.material[i]));
      is("label", value_of(tile.label[i]));
    });
  }
  for (int i = 0; i < 1000; ++i) {  // cells beside them
    const Cell cell = {static_cast<int>(random() % 300), static_cast<int>(random() % 200),
                       static_cast<int>(random() % 150)};
    for (const auto& [name, of_name] : grids) {
      const NanoGrid::Voxel voxel = of_name.voxel(cell);
      if (voxel.is_active) continue;
      EXPECT_EQ(voxel.value, of_name.background()) << name;
    }
  }
}

TEST(Nvdb, types_and_classes) {
  Grid grid = test::random_grid(1, {20, 20, 20}, 50, true, true);
  grid.channels = channels_of_bits(~uint32_t{0});
  for (SparseTile& tile : grid.tiles) resize_channels(tile, grid.channels);
  NanoGrids grids = nano_grids(grid);
  const auto check = [&](const char* name, uint32_t type, uint32_t of) {
    EXPECT_EQ(grids.at(name).type(), type) << name;
    EXPECT_EQ(grids.at(name).grid_class(), of) << name;
  };
  check("density", kFloatType, kFogClass);
  check("surface", kFloatType, kUnknownClass);  // voxels are no cubes, and fill is unknown
  check("color", kVec3fType, kUnknownClass);
  check("normal", kVec3fType, kUnknownClass);
  check("material", kInt32Type, kUnknownClass);
  check("label", kInt32Type, kUnknownClass);
  grid.spec.voxel_size = glm::dvec3(0.5);
  grid.meta = GridMeta::parse(R"({"options":{"fill":"solid"}})");
  grids = nano_grids(grid);
  check("surface", kFloatType, kLevelSetClass);
}

TEST(Nvdb, an_index_is_the_centre_of_its_cell) {
  Grid grid = test::grid_of({20, 20, 20}, {{.cell = {3, 4, 5}}, {.cell = {6, 4, 5}}}, {});
  const NanoGrid density = nano_grids(grid).at("density");
  const std::array<double, 3> sides = {0.5, 0.25, 0.125};
  const std::array<double, 3> center = {-1.25, 0.375, 1e10 + 0.0625};
  const Cell first = {3, 4, 5}, after = {7, 5, 6};
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(density.at<double>(608 + 8 * c), sides[c]);
    for (size_t row = 0; row < 3; ++row) {
      const size_t i = 3 * row + c;
      EXPECT_EQ(density.at<float>(296 + 4 * i), row == c ? static_cast<float>(sides[c]) : 0);
      EXPECT_EQ(density.at<float>(332 + 4 * i), row == c ? static_cast<float>(1 / sides[c]) : 0);
      EXPECT_EQ(density.at<double>(384 + 8 * i), row == c ? sides[c] : 0);
      EXPECT_EQ(density.at<double>(456 + 8 * i), row == c ? 1 / sides[c] : 0);
    }
    EXPECT_EQ(density.at<float>(368 + 4 * c), static_cast<float>(center[c]));
    EXPECT_EQ(density.at<double>(528 + 8 * c), center[c]);
    EXPECT_EQ(density.at<double>(560 + 8 * c), center[c] + first[c] * sides[c]);
    EXPECT_EQ(density.at<double>(584 + 8 * c), center[c] + after[c] * sides[c]);
  }
  EXPECT_EQ(density.at<float>(380), 1);  // no taper
  EXPECT_EQ(density.at<double>(552), 1);
}

TEST(Nvdb, a_grid_without_voxels_has_a_background_alone) {
  Grid grid;
  grid.spec.dims = {100, 100, 100};
  grid.channels = {.color = true, .distance = true};
  const NanoGrids grids = nano_grids(grid);
  EXPECT_EQ(nano_names(grids), (std::vector<std::string>{"color", "density", "surface"}));
  for (const auto& [name, of_name] : grids) {
    EXPECT_EQ(of_name.active_count(), 0U);
    EXPECT_EQ(of_name.root_tiles(), 0U);
    EXPECT_EQ(of_name.voxel({1, 2, 3}).value, of_name.background());
    EXPECT_GT(of_name.at<double>(560), of_name.at<double>(584));  // an empty box
  }
}

TEST(Nvdb, full_nodes_are_tiles) {
  const ChannelSet channels = {.color = true, .normal = true, .label = true};
  Grid grid = test::grid_of(
      {600, 256, 256}, {{.cell = {300, 1, 2}, .color = {255, 0, 0, 255}, .label = 9}}, channels);
  SparseTile& tile = grid.tiles[0];
  tile.full = {{morton_encode(0, 8, 0), 2}, {morton_encode(16, 16, 16), 4}};
  const NanoGrids grids = nano_grids(grid);
  const std::map<std::string, Value> inner = {{"density", value_of(1)},
                                              {"color", value_of(1)},  // red
                                              {"normal", value_of(0)},
                                              {"label", value_of(0)}};
  for (const auto& [name, value] : inner) {
    const NanoGrid& of_name = grids.at(name);
    EXPECT_EQ(of_name.leaves(), 1U);
    EXPECT_EQ(of_name.tiles(0), 64U);
    EXPECT_EQ(of_name.tiles(1), 1U);
    EXPECT_EQ(of_name.active_count(), 1U + 32 * 32 * 32 + 128 * 128 * 128);
    for (const Cell& cell : {Cell{256, 64, 0}, {287, 95, 31}, {384, 128, 128}, {511, 255, 255}}) {
      EXPECT_TRUE(of_name.voxel(cell).is_active);
      EXPECT_EQ(of_name.voxel(cell).value, value);
    }
    EXPECT_EQ(of_name.voxel({256, 64, 0}).side, 8);
    EXPECT_EQ(of_name.voxel({511, 255, 255}).side, 128);
    EXPECT_FALSE(of_name.voxel({0, 0, 0}).is_active);
  }
  EXPECT_EQ(grids.at("label").voxel({300, 1, 2}).value, value_of(9));
}

TEST(Nvdb, a_brick_of_equal_values_is_a_tile) {
  std::vector<test::TestVoxel> voxels;
  for (int i = 0; i < 512; ++i) {
    voxels.push_back({.cell = {8 + i % 8, i / 8 % 8, i / 64},
                      .color = {9, 9, 9, 255},
                      .label = static_cast<uint16_t>(i == 77 ? 2 : 1)});
  }
  const NanoGrids grids =
      nano_grids(test::grid_of({16, 8, 8}, voxels, {.color = true, .label = true}));
  EXPECT_EQ(grids.at("density").leaves(), 0U);
  EXPECT_EQ(grids.at("density").voxel({9, 1, 1}).side, 8);
  EXPECT_EQ(grids.at("color").leaves(), 0U);
  EXPECT_EQ(grids.at("label").leaves(), 1U);
  EXPECT_EQ(grids.at("label").active_count(), 512U);
}

TEST(Nvdb, a_whole_tile_of_the_grid_and_bricks_of_one_value_are_tiles_of_the_upper_node) {
  Grid grid;
  grid.spec.dims = {512, 256, 256};
  SparseTile& whole = grid.tiles.emplace_back();
  whole.full = {{0, kTileLevels}};
  SparseTile& bricks = grid.tiles.emplace_back();
  bricks.coord = {1, 0, 0};
  grid.channels = {.coverage = true};
  for (uint32_t i = 0; i < 4096; ++i) {
    bricks.brick_morton.push_back(i);
    bricks.masks.emplace_back().words.fill(~uint64_t{0});
  }
  bricks.coverage.assign(size_t{4096} * 512, 255);
  const NanoGrid density = nano_grids(grid).at("density");
  EXPECT_EQ(density.tiles(1), 9U);
  EXPECT_EQ(density.leaves(), 0U);
  EXPECT_EQ(density.active_count(), 9U * 128 * 128 * 128);
}

TEST(Nvdb, a_lower_node_of_many_leaves_is_written_in_pieces) {
  Grid grid;
  grid.spec.dims = {256, 256, 256};
  grid.channels = {.label = true};
  SparseTile& tile = grid.tiles.emplace_back();
  for (uint32_t i = 0; i < 4096; ++i) {
    tile.brick_morton.push_back(i);
    tile.masks.emplace_back().words.fill(~uint64_t{0});
  }
  tile.label.resize(size_t{4096} * 512);
  std::mt19937 random(9);
  for (uint16_t& label : tile.label) label = static_cast<uint16_t>(random());
  const NanoGrid label = nano_grids(grid).at("label");
  EXPECT_EQ(label.leaves(), 4096U);
  for_each_voxel(tile, [&](int32_t x, int32_t y, int32_t z, size_t i) {
    if (i % 97 != 0) return;
    EXPECT_EQ(label.voxel({x, y, z}).value, value_of(tile.label[i]));
  });
}

// The distances of a sphere, in 1/kDistanceSteps voxel, at the cells near it.
Grid nano_band_of_sphere(const Cell& dims, const Value& center, double radius) {
  std::vector<test::TestVoxel> voxels;
  for (int x = 0; x < dims[0]; ++x) {
    for (int y = 0; y < dims[1]; ++y) {
      for (int z = 0; z < dims[2]; ++z) {
        const double distance =
            std::hypot(x + 0.5 - center[0], y + 0.5 - center[1], z + 0.5 - center[2]) - radius;
        if (std::abs(distance) > 2) continue;
        voxels.push_back(
            {.cell = {x, y, z}, .distance = static_cast<int16_t>(std::lround(distance * 128))});
      }
    }
  }
  Grid grid = test::grid_of(dims, voxels, {.distance = true});
  grid.spec.voxel_size = glm::dvec3(0.5);
  grid.meta = GridMeta::parse(R"({"options":{"fill":"band"}})");
  return grid;
}

TEST(Nvdb, cells_inside_a_band_are_minus_the_background) {
  const Cell dims = {150, 140, 160};
  for (const double x : {75.0, 150.0}) {  // inside, and cut by the grid
    const Value center = {x, 66, 82};
    const NanoGrids grids = nano_grids(nano_band_of_sphere(dims, center, 60));
    EXPECT_EQ(nano_names(grids), (std::vector<std::string>{"surface"}));
    const NanoGrid& surface = grids.at("surface");
    EXPECT_EQ(surface.grid_class(), kLevelSetClass);
    const double background = surface.background()[0];
    EXPECT_GT(background, 0.98);
    size_t inside = 0;
    for (int i = 0; i < dims[0]; i += 3) {
      for (int j = 0; j < dims[1]; j += 3) {
        for (int k = 0; k < dims[2]; ++k) {
          const double distance =
              std::hypot(i + 0.5 - center[0], j + 0.5 - center[1], k + 0.5 - center[2]) - 60;
          const double value = surface.voxel({i, j, k}).value[0];
          ASSERT_NEAR(value, std::clamp(distance / 2, -1.0, 1.0), 1.0 / 64)
              << i << " " << j << " " << k;
          inside += value == -background ? 1 : 0;
        }
      }
    }
    EXPECT_GT(inside, 20'000U);
    EXPECT_EQ(surface.voxel({152, 66, 82}).value[0], background);  // nothing beyond the grid
  }
}

TEST(Nvdb, a_tile_of_the_root_between_two_parts_of_a_band_is_inside) {
  Grid grid = test::grid_of(
      {8, 8, 14000},
      {{.cell = {0, 0, 100}, .distance = -64}, {.cell = {0, 0, 12300}, .distance = 64}},
      {.distance = true});
  grid.meta = GridMeta::parse(R"({"options":{"fill":"band"}})");
  grid.spec.voxel_size = glm::dvec3(1);
  const NanoGrid surface = nano_grids(grid).at("surface");
  EXPECT_EQ(surface.root_tiles(), 4U);
  for (const int z : {4000, 4096, 8192, 12000}) {
    EXPECT_EQ(surface.voxel({0, 0, z}).value, value_of(-0.5)) << z;
    EXPECT_FALSE(surface.voxel({0, 0, z}).is_active);
  }
  EXPECT_EQ(surface.voxel({0, 0, 4096}).side, 4096);
  EXPECT_EQ(surface.voxel({0, 0, 13000}).value, value_of(0.5));
}

TEST(Nvdb, tiles_of_the_root_beside_a_part_of_a_band_have_its_side) {
  for (const int axis : {0, 1, 2}) {
    Cell dims = {8, 8, 8}, cell{};
    dims[static_cast<size_t>(axis)] = 16384;
    cell[static_cast<size_t>(axis)] = 8200;
    Grid grid = test::grid_of(dims, {{.cell = cell, .distance = -64}}, {.distance = true});
    grid.meta = GridMeta::parse(R"({"options":{"fill":"band"}})");
    grid.spec.voxel_size = glm::dvec3(1);
    const NanoGrid surface = nano_grids(grid).at("surface");
    EXPECT_EQ(surface.root_tiles(), 4U);
    for (const int at : {0, 4095, 4096, 8199, 8201, 12288, 16383}) {
      cell[static_cast<size_t>(axis)] = at;
      EXPECT_EQ(surface.voxel(cell).value, value_of(-0.5)) << axis << " " << at;
    }
  }
}

TEST(Nvdb, a_band_that_does_not_tell_sides_is_no_level_set) {
  Grid grid = nano_band_of_sphere({40, 40, 40}, {20, 20, 20}, 15);
  grid.meta = grid.meta.with_band_voxels(0.7);
  const NanoGrids grids = nano_grids(grid);
  EXPECT_EQ(nano_names(grids), (std::vector<std::string>{"density", "surface"}));
  EXPECT_EQ(grids.at("surface").grid_class(), kUnknownClass);
  EXPECT_EQ(grids.at("surface").voxel({20, 20, 20}).value[0], grids.at("surface").background()[0]);
  Grid empty = test::grid_of({8, 8, 8}, {}, {.distance = true});
  empty.spec.voxel_size = glm::dvec3(1);
  empty.meta = GridMeta::parse(R"({"options":{"fill":"band"}})");
  EXPECT_EQ(nano_grids(empty).at("surface").grid_class(), kUnknownClass) << "no voxels";
}

TEST(Nvdb, nodes_above_4096_cells_are_in_order) {
  std::vector<test::TestVoxel> voxels;
  for (const int x : {0, 4095, 4096, 12300}) {
    for (const int y : {5, 8000}) voxels.push_back({.cell = {x, y, 16000 - y}});
  }
  const Grid grid = test::grid_of({16384, 16384, 16384}, voxels, {});
  const NanoGrid density = nano_grids(grid).at("density");
  EXPECT_EQ(density.active_count(), voxels.size());
  EXPECT_EQ(density.root_tiles(), 6U);
  for (const test::TestVoxel& voxel : voxels) {
    const auto [x, y, z] = voxel.cell;
    EXPECT_EQ(density.voxel({x, y, z}).value, value_of(1));
    EXPECT_FALSE(density.voxel({x, y, z - 1}).is_active);
  }
}

TEST(Nvdb, equal_grids_give_equal_bytes) {
  const Grid grid = test::random_grid(5, {300, 270, 40}, 9000, true, true);
  EXPECT_EQ(encode(grid, to(Format::kNvdb)).value(), encode(grid, to(Format::kNvdb)).value());
}

TEST(Nvdb, pinned_bytes_of_one_voxel) {
  const Grid grid = test::grid_of({8, 8, 8}, {{.cell = {0, 0, 1}}}, {});
  const Bytes bytes = encode(grid, to(Format::kNvdb)).value();
  // Magic, version 32.4.2, one grid, zip; bytes of the grid: 672 + 64 + 64 + 32 + a node of each.
  const Bytes head = {'N', 'a', 'n', 'o', 'V',  'D',  'B', '0', 2, 0x10, 0, 4,
                      1,   0,   1,   0,   0x20, 0xb0, 4,   0,   0, 0,    0, 0};
  EXPECT_EQ(Bytes(bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(head.size())), head);
  const size_t grid_at = 16 + 176 + sizeof "density";
  // The zlib stream begins with a stored block of 832 bytes.
  const Bytes stream = {0x78, 0x01, 0, 0x40, 0x03, 0xbf, 0xfc, 'N', 'a', 'n', 'o'};
  const auto begin = bytes.begin() + static_cast<ptrdiff_t>(grid_at + 8);
  EXPECT_EQ(Bytes(begin, begin + static_cast<ptrdiff_t>(stream.size())), stream);
}

TEST(Nvdb, names_of_ids_and_units_are_lost) {
  Grid grid = test::random_grid(1, {20, 20, 20}, 50, true, false);
  grid.spec.voxel_size = glm::dvec3(0.5);
  const auto codes = [&] {
    std::string all;
    for (const Warning& warning : encode_warnings(grid, to(Format::kNvdb))) {
      all += warning.code + " ";
    }
    return all;
  };
  EXPECT_EQ(codes(), "lost-units ");  // mm
  grid.channels.label = true;
  EXPECT_EQ(codes(), "lost-names lost-units ");
  grid.meta = GridMeta();
  EXPECT_EQ(codes(), "lost-names ");
}

TEST(Nvdb, more_leaves_than_32_bits_count_are_refused) {
  EXPECT_TRUE(vdb::check_nano_leaves(UINT32_MAX));
  const Status refused = vdb::check_nano_leaves(uint64_t{1} << 32);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kGridTooLarge);
  EXPECT_EQ(refused.error().message(),
            "nvdb: too many bricks of 8x8x8 cells: expected at most 4294967295, got 4294967296");
}

TEST(Nvdb, a_cancelled_task_ends) {
  const Grid grid = test::random_grid(5, {300, 270, 40}, 9000, true, true);
  const std::atomic<bool> flag{true};
  const CancelScope scope(flag);
  EXPECT_THROW((void)encode(grid, to(Format::kNvdb)), Cancelled);
}

}  // namespace
}  // namespace voxeld::nvdb_test
