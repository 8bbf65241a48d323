#include "tests/unit/formats/npy/npy_reader.h"
#include "tests/unit/formats/vox_reader.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <string>

#include "server/base/cancel_point.h"
#include "server/formats/formats.h"
#include "server/formats/vox_parts.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

using Cells = std::map<std::array<int, 3>, std::array<uint8_t, 3>>;

test::VoxScene written_scene(const Grid& grid, int palette_max = 255) {
  OutputOptions options;
  options.palette_max = palette_max;
  const auto bytes = test::encode_as(Format::kVox, grid, options);
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message());
  return bytes ? test::VoxReader::read(*bytes) : test::VoxScene();
}

// z up: (x, -z, y), moved so that the scene is centred in x and y and stands on the floor.
std::array<int, 3> scene_cell(const Grid& grid, int x, int y, int z) {
  const glm::ivec3 dims = grid.spec.dims;
  return {x - dims.x / 2, dims.z - 1 - z - dims.z / 2, y};
}
Cells expected_cells(const Grid& grid) {
  Cells cells;
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      const uint8_t* c = &tile.color[4 * voxel];
      cells[scene_cell(grid, x, y, z)] = {c[0], c[1], c[2]};
    });
  }
  return cells;
}

// At most `colors` colours, anywhere in the grid.
Grid colored_grid(const std::array<int, 3>& dims, int voxels, int colors) {
  Grid grid = test::random_grid(11, dims, voxels, true, false);
  for (SparseTile& tile : grid.tiles) {
    for (size_t v = 0; 4 * v < tile.color.size(); ++v) {
      const auto i = static_cast<uint32_t>(tile.color[4 * v] * 256 + tile.color[4 * v + 1]);
      const uint32_t key = i % static_cast<uint32_t>(colors) * 2654435761u;
      for (size_t c = 0; c < 3; ++c) tile.color[4 * v + c] = static_cast<uint8_t>(key >> (8 * c));
    }
  }
  return grid;
}

TEST(Vox, a_small_grid_is_one_model_with_its_cells_and_colours) {
  const Grid grid = colored_grid({20, 31, 42}, 800, 255);
  const auto scene = written_scene(grid);
  ASSERT_EQ(scene.models.size(), 1u);
  EXPECT_EQ(scene.models[0].size, (std::array<int, 3>{20, 42, 31}));
  EXPECT_TRUE(scene.cells() == expected_cells(grid));
  EXPECT_EQ(scene.chunks,
            (std::vector<std::string>{"SIZE", "XYZI", "nTRN", "nGRP", "nTRN", "nSHP", "RGBA"}));
}

TEST(Vox, cells_above_256_are_models_that_join_without_gaps) {
  const Grid grid = colored_grid({600, 270, 300}, 4000, 200);
  ASSERT_GT(grid.tiles.size(), 6u);
  const auto scene = written_scene(grid);
  EXPECT_GT(scene.models.size(), 6u);
  EXPECT_LE(scene.models.size(), 3u * 2u * 2u);
  EXPECT_TRUE(scene.cells() == expected_cells(grid));
}

TEST(Vox, cells_on_both_sides_of_a_seam_stay_neighbours_for_odd_and_even_rests) {
  for (const int side : {257, 258, 511, 512, 513}) {
    const Grid grid = test::grid_of(
        {side, side, side}, test::box_voxels({254, 254, 254}, {257, 257, 257}), true, false);
    EXPECT_TRUE(written_scene(grid).cells() == expected_cells(grid)) << side;
  }
}

TEST(Vox, voxels_of_full_nodes_have_the_mean_colour_of_the_others) {
  Grid grid = test::grid_with_a_full_brick(true, false);
  const auto cells = written_scene(grid).cells();
  EXPECT_EQ(cells.size(), 513u);
  EXPECT_EQ(cells.at(scene_cell(grid, 15, 8, 9)), (std::array<uint8_t, 3>{10, 20, 30}));
  grid.tiles[0].masks.clear();
  grid.tiles[0].brick_morton.clear();
  grid.tiles[0].color.clear();
  EXPECT_EQ(written_scene(grid).cells().at(scene_cell(grid, 8, 8, 8)), kNeutralColor);
  grid.tiles[0].full = {{0, kTileLevels}};
  grid.spec.dims = {2048, 2048, 2048};
  grid.tiles.resize(32, grid.tiles[0]);
  EXPECT_EQ(test::encode_as(Format::kVox, grid, {}).error().code, ErrorCode::kGridTooLarge);
}

TEST(Vox, voxels_inside_of_a_solid_have_the_mean_colour_in_bricks_that_are_not_full_too) {
  const Grid grid = test::grid_of(
      {16, 16, 16}, {{.cell = {0, 0, 0}, .color = {200, 10, 10, 255}}, {.cell = {1, 0, 0}}},
      ChannelSet{.color = true});
  const std::array<uint8_t, 3> red = {200, 10, 10};
  const auto scene = written_scene(grid);
  EXPECT_EQ(scene.cells().at(scene_cell(grid, 1, 0, 0)), red);
  EXPECT_EQ(scene.palette.at(0), (std::array<uint8_t, 4>{200, 10, 10, 255}));
  OutputOptions options;
  options.palette = {{0, 0, 0}, {200, 10, 10}};
  for (const Dither dither : {Dither::kNone, Dither::kBayer, Dither::kError}) {
    options.dither = dither;
    const auto bytes = test::encode_as(Format::kVox, grid, options);
    ASSERT_TRUE(bytes);
    for (const auto& [cell, color] : test::VoxReader::read(*bytes).cells()) EXPECT_EQ(color, red);
  }
}

TEST(Vox, a_grid_without_colours_has_one_for_each_label_or_material) {
  std::vector<test::TestVoxel> voxels(3);
  for (int i = 0; i < 3; ++i) {
    voxels[static_cast<size_t>(i)].cell = {i, 0, 0};
    voxels[static_cast<size_t>(i)].material = static_cast<uint16_t>(1 + i / 2);
    voxels[static_cast<size_t>(i)].label = static_cast<uint16_t>(i);
  }
  const std::array<int, 3> dims = {8, 8, 8};
  const Grid by_material = test::grid_of(dims, voxels, {.material = true});
  const auto cells = written_scene(by_material).cells();
  for (const auto& voxel : voxels) {
    EXPECT_EQ(cells.at(scene_cell(by_material, voxel.cell[0], 0, 0)), id_color(voxel.material));
  }
  const auto labelled =
      written_scene(test::grid_of(dims, voxels, {.material = true, .label = true}));
  for (const auto& voxel : voxels) {
    EXPECT_EQ(labelled.cells().at(scene_cell(by_material, voxel.cell[0], 0, 0)),
              id_color(voxel.label));
  }
  const auto colored = written_scene(test::grid_of(dims, voxels, {.color = true, .label = true}));
  EXPECT_EQ(colored.cells().begin()->second, kNeutralColor);
  std::set<std::array<uint8_t, 3>> colors;
  for (uint16_t id = 0; id < 100; ++id) colors.insert(id_color(id));
  EXPECT_EQ(colors.size(), 100u);
}

TEST(Vox, labels_are_groups_with_their_names) {
  std::vector<test::TestVoxel> voxels;
  for (const auto& [x, label] : std::map<int, uint16_t>{{0, 2}, {1, 1}, {2, 0}, {290, 2}}) {
    auto& voxel = voxels.emplace_back();
    voxel.cell = {x, 0, 0};
    voxel.label = label;
  }
  Grid grid = test::grid_of({300, 8, 8}, voxels, {.color = true, .label = true});
  grid.meta = GridMeta::parse(R"({"labels":[{"id":1,"name":"left wheel"},{"id":2,"name":""}]})");
  const test::VoxScene scene = written_scene(grid);
  EXPECT_EQ(scene.cells().size(), 4u);
  using Group = std::pair<std::string, std::set<std::array<int, 3>>>;
  std::vector<Group> groups;
  std::set<int> models;
  for (const int node : scene.groups.at(1)) {
    const test::VoxDict& attributes = scene.transforms.at(node).attributes;
    auto& group = groups.emplace_back();
    if (attributes.contains("_name")) group.first = attributes.at("_name");
    for (const auto& [cell, color] : scene.cells_below(node, models)) group.second.insert(cell);
  }
  const auto cell = [&](int x) { return scene_cell(grid, x, 0, 0); };
  EXPECT_EQ(groups, (std::vector<Group>{
                        {"", {cell(2)}}, {"left wheel", {cell(1)}}, {"", {cell(0), cell(290)}}}));
}

TEST(Vox, the_turn_to_z_up_keeps_handedness) {
  const Grid grid = test::grid_of({10, 10, 10},
                                  {{{1, 0, 0}, {1, 0, 0, 255}, {}},
                                   {{0, 2, 0}, {0, 1, 0, 255}, {}},
                                   {{0, 0, 3}, {0, 0, 1, 255}, {}},
                                   {{0, 0, 0}, {0, 0, 0, 255}, {}}},
                                  true, false);
  std::map<std::array<uint8_t, 3>, std::array<int, 3>> place;
  for (const auto& [cell, color] : written_scene(grid).cells()) place[color] = cell;
  const auto origin = place.at({0, 0, 0});
  const auto offset = [&](const std::array<uint8_t, 3>& color) {
    const auto& cell = place.at(color);
    return std::array<int, 3>{cell[0] - origin[0], cell[1] - origin[1], cell[2] - origin[2]};
  };
  EXPECT_EQ(offset({1, 0, 0}), (std::array<int, 3>{1, 0, 0}));
  EXPECT_EQ(offset({0, 1, 0}), (std::array<int, 3>{0, 0, 2}));
  EXPECT_EQ(offset({0, 0, 1}), (std::array<int, 3>{0, -3, 0}));
}

TEST(Vox, the_root_says_where_the_grid_lies) {
  const auto scene = written_scene(test::random_grid(1, {7, 8, 9}, 20, true, false));
  const auto& attributes = scene.transforms.at(0).attributes;
  EXPECT_EQ(attributes.at("dims"), "7,8,9");
  EXPECT_EQ(attributes.at("origin"), "-1.5,0.25,1e+10");
  EXPECT_EQ(attributes.at("voxel_size"), "0.5,0.25,0.125");
  EXPECT_EQ(attributes.at("units"), "mm");
}

TEST(Vox, colours_above_the_palette_are_near_ones_and_the_palette_is_kept) {
  const Grid grid = colored_grid({60, 60, 60}, 6000, 3000);
  const Cells exact = expected_cells(grid);
  for (const int palette_max : {255, 16, 1}) {
    const Cells cells = written_scene(grid, palette_max).cells();
    ASSERT_EQ(cells.size(), exact.size());
    std::set<std::array<uint8_t, 3>> used;
    for (const auto& [cell, color] : cells) {
      EXPECT_TRUE(exact.contains(cell));
      used.insert(color);
    }
    EXPECT_LE(used.size(), static_cast<size_t>(palette_max));
  }
}

TEST(Vox, a_palette_of_the_request_is_kept_in_its_order) {
  const Grid grid = colored_grid({60, 60, 60}, 6000, 3000);
  OutputOptions options;
  options.palette = {{255, 255, 255}, {10, 20, 30}, {200, 40, 40}};
  const auto bytes = test::encode_as(Format::kVox, grid, options);
  ASSERT_TRUE(bytes);
  const test::VoxScene scene = test::VoxReader::read(*bytes);
  for (size_t i = 0; i < options.palette.size(); ++i) {
    const PaletteColor& color = options.palette[i];
    EXPECT_EQ(scene.palette.at(i), (std::array<uint8_t, 4>{color[0], color[1], color[2], 255}));
  }
  const auto cells = scene.cells();
  EXPECT_EQ(cells.size(), expected_cells(grid).size());
  for (const auto& [cell, color] : cells) {
    EXPECT_NE(std::ranges::find(options.palette, color), options.palette.end());
  }
}

TEST(Vox, a_grid_without_colours_is_grey) {
  const Grid grid = test::grid_of({5, 5, 5}, test::box_voxels({1, 1, 1}, {3, 3, 3}), false, false);
  const auto cells = written_scene(grid).cells();
  EXPECT_EQ(cells.size(), 8u);
  for (const auto& [cell, color] : cells) {
    EXPECT_EQ(color, (std::array<uint8_t, 3>{0xb4, 0xb4, 0xb4}));
  }
}

TEST(Vox, an_empty_grid_is_one_empty_model) {
  for (const bool color : {false, true}) {
    const auto scene = written_scene(test::grid_of({5, 6, 7}, {}, color, false));
    ASSERT_EQ(scene.models.size(), 1u);
    EXPECT_EQ(scene.models[0].size, (std::array<int, 3>{5, 7, 6}));
    EXPECT_TRUE(scene.cells().empty());
  }
}

TEST(Vox, equal_grids_give_equal_bytes_whatever_the_order_of_tiles) {
  Grid grid = colored_grid({600, 270, 300}, 1000, 700);
  const auto first = test::encode_as(Format::kVox, grid, {});
  normalize_tiles(grid);
  const auto second = test::encode_as(Format::kVox, grid, {});
  ASSERT_TRUE(first && second);
  EXPECT_EQ(*first, *second);
}

TEST(Vox, a_cancelled_task_ends_within_a_model) {
  vox::Bytes bytes;
  const std::vector<vox::Voxel> voxels(8);
  const std::atomic<bool> flag{true};
  const CancelScope scope(flag);
  EXPECT_THROW(vox::add_model(bytes, {}, voxels, {2, 2, 2}), Cancelled);
}

TEST(Vox, what_the_editor_does_not_show_is_told) {
  OutputOptions options;
  options.format = Format::kVox;
  Grid grid;
  grid.spec.dims = {2000, 1000, 2000};
  EXPECT_TRUE(encode_warnings(grid, options).empty());
  for (const glm::ivec3 dims : {glm::ivec3(2001, 5, 5), {5, 1001, 5}, {5, 5, 2001}}) {
    grid.spec.dims = dims;
    const auto warnings = encode_warnings(grid, options);
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_EQ(warnings[0].code, "outside-world");
    EXPECT_EQ(warnings[0].detail, "vox: MagicaVoxel shows 2000 x 1000 (up) x 2000 cells of " +
                                      std::to_string(dims.x) + " x " + std::to_string(dims.y) +
                                      " x " + std::to_string(dims.z));
  }
  options.format = Format::kNpy;
  EXPECT_TRUE(encode_warnings(grid, options).empty());
}

}  // namespace
}  // namespace voxeld
