// The whole way from scene to grid without a GL context: what needs no other pipeline to compare
// with. tests/gpu/voxel holds cpu against raster and compute.
#include "server/voxel/voxelize.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <iterator>
#include <map>
#include <random>
#include <string>

#include <glm/geometric.hpp>

#include "server/grid/color/color_tables.h"

namespace voxeld {
namespace {

// Triangles with normals, colours and texture coordinates; every third as wide as the box.
Scene colored_soup(int count, float extent, bool textured) {
  std::mt19937 random(7);
  const auto unit = [&] { return static_cast<float>(random()) / 4294967296.0f; };
  Scene scene;
  MeshPart part;
  for (int t = 0; t < count; ++t) {
    const glm::vec3 at = glm::vec3(unit(), unit(), unit()) * extent;
    const float size = t % 3 == 0 ? extent : extent / 20.0f;
    for (uint32_t corner = 0; corner < 3; ++corner) {
      const glm::vec3 p = at + (glm::vec3(unit(), unit(), unit()) - 0.5f) * size;
      part.indices.push_back(static_cast<uint32_t>(part.positions.size()));
      part.positions.push_back(glm::clamp(p, glm::vec3(0.0f), glm::vec3(extent)));
      part.normals.push_back(glm::normalize(glm::vec3(unit(), unit(), unit()) - 0.4f));
      part.colors.emplace_back(unit(), unit(), unit(), unit());
      part.uvs.emplace_back(3.0f * unit() - 1.0f, 3.0f * unit() - 1.0f);
    }
  }
  if (textured) {
    Image image;
    image.width = 37;
    image.height = 20;
    for (int i = 0; i < 4 * 37 * 20; ++i) image.rgba.push_back(static_cast<uint8_t>(random()));
    scene.images.push_back(image);
    Material material;
    material.image = 0;
    scene.materials.push_back(material);
    part.material = 0;
  }
  scene.parts.push_back(part);
  return scene;
}

VoxelizeOptions all_channels(int size) {
  VoxelizeOptions options;
  options.placement.size = size;
  options.channels = ChannelSet{.color = true, .normal = true};
  return options;
}

Grid voxelized(Voxelizer& voxelizer, const Scene& scene, const VoxelizeOptions& options) {
  auto grid = voxelizer.voxelize(scene, options, {}, nullptr);
  EXPECT_TRUE(grid.ok()) << grid.error().message();
  return grid.ok() ? std::move(grid).value() : Grid();
}

TEST(VoxelizerWithoutDevice, number_of_threads_does_not_change_a_byte) {
  for (const bool textured : {false, true}) {
    const Scene scene = colored_soup(200, 10.0f, textured);
    const VoxelizeOptions options = all_channels(300);
    Voxelizer alone(nullptr, 1), crowd(nullptr, 7);
    const Grid one = voxelized(alone, scene, options), many = voxelized(crowd, scene, options);
    ASSERT_EQ(one.tiles.size(), 8u);
    EXPECT_TRUE(one.tiles == many.tiles);
  }
}

TEST(VoxelizerWithoutDevice, channels_do_not_change_the_voxels) {
  const Scene scene = colored_soup(300, 10.0f, false);
  VoxelizeOptions options = all_channels(300);
  Voxelizer voxelizer;
  const Grid all = voxelized(voxelizer, scene, options);
  options.channels->color = options.channels->normal = false;
  const Grid bare = voxelized(voxelizer, scene, options);
  ASSERT_EQ(all.tiles.size(), bare.tiles.size());
  for (size_t i = 0; i < all.tiles.size(); ++i) {
    EXPECT_TRUE(all.tiles[i].masks == bare.tiles[i].masks);
    EXPECT_TRUE(all.tiles[i].brick_morton == bare.tiles[i].brick_morton);
    EXPECT_EQ(all.tiles[i].color.size(), 4 * all.tiles[i].voxel_count());
    EXPECT_EQ(all.tiles[i].normal.size(), 3 * all.tiles[i].voxel_count());
    EXPECT_TRUE(bare.tiles[i].color.empty());
  }
}

// Two squares of the plane z = 0.5 over cells 0..3 and 4..7, one red and one blue.
TEST(VoxelizerWithoutDevice, colours_and_normals_are_those_of_the_surface) {
  Scene scene;
  MeshPart part;
  for (const float x : {0.0f, 4.0f}) {
    const auto first = static_cast<uint32_t>(part.positions.size());
    for (const glm::vec2 corner : {glm::vec2(0, 0), {1, 0}, {1, 1}, {0, 1}}) {
      part.positions.emplace_back(x + 4.0f * corner.x, 8.0f * corner.y, 0.5f);
      part.colors.emplace_back(x == 0.0f ? glm::vec4(1, 0, 0, 1) : glm::vec4(0, 0, 1, 1));
    }
    for (const uint32_t i : {0u, 1u, 2u, 0u, 2u, 3u}) part.indices.push_back(first + i);
  }
  scene.parts.push_back(part);
  VoxelizeOptions options = all_channels(8);
  options.placement.size.reset();
  options.placement.voxel_size = {1.0, 1.0, 1.0};
  options.placement.bounds = {0, 0, 0, 8, 8, 8};
  Voxelizer voxelizer;
  VoxelizeStats stats;
  const auto grid = voxelizer.voxelize(scene, options, {}, &stats);
  ASSERT_TRUE(grid.ok()) << grid.error().message();
  EXPECT_EQ(stats.pipeline, Pipeline::kCpu);
  EXPECT_EQ(stats.pipeline_reason, "cpu: there is no GL context");
  ASSERT_EQ(grid->tiles.size(), 1u);
  const SparseTile& tile = grid->tiles[0];
  EXPECT_EQ(tile.voxel_count(), 64u);
  size_t wrong = 0;
  for_each_voxel(tile, [&](int x, int, int z, size_t voxel) {
    const uint8_t* color = &tile.color[4 * voxel];
    // The red square's corners at x = 4 stand half a sub-voxel inside the cells there.
    const int tolerance = x == 4 ? 2 : 0;
    wrong += z != 0 || std::abs(color[0] - (x < 4 ? 255 : 0)) > tolerance;
    wrong += std::abs(color[2] - (x < 4 ? 0 : 255)) > tolerance;
    wrong += color[1] != 0 || color[3] != 255 || tile.normal[3 * voxel + 2] != 127;
  });
  EXPECT_EQ(wrong, 0u);
}

TEST(VoxelizerWithoutDevice, pipelines_of_a_gl_context_are_refused) {
  const Scene scene = colored_soup(3, 1.0f, false);
  VoxelizeOptions options = all_channels(16);
  for (const auto& [pipeline, name] : {std::pair{PipelineChoice::kRaster, "raster"},
                                       std::pair{PipelineChoice::kCompute, "compute"}}) {
    options.pipeline = pipeline;
    Voxelizer voxelizer;
    const auto grid = voxelizer.voxelize(scene, options, {}, nullptr);
    ASSERT_FALSE(grid.ok());
    EXPECT_EQ(grid.error().code, ErrorCode::kUnsupportedFeature);
    EXPECT_EQ(grid.error().message(),
              std::string("pipeline ") + name +
                  " needs a GL context, and this device has none: expected pipeline=cpu or auto, "
                  "got " +
                  name);
  }
}

TEST(VoxelizerWithoutDevice, an_estimate_needs_no_device_memory) {
  Voxelizer voxelizer;
  const auto estimate = voxelizer.estimate(colored_soup(30, 1.0f, false), all_channels(64));
  ASSERT_TRUE(estimate.ok()) << estimate.error().message();
  EXPECT_EQ(estimate->device_bytes, 0);
  EXPECT_GT(estimate->host_bytes, 0);
}

// Rectangles [x0, x1] x [y0, y1] at height z, each with its material.
struct Sheet {
  double x0, y0, x1, y1, z;
  int material;
};

Scene sheets(const std::vector<Sheet>& all, int materials) {
  Scene scene;
  scene.materials.resize(static_cast<size_t>(materials));
  for (const Sheet& sheet : all) {
    MeshPart& part = scene.parts.emplace_back();
    part.material = sheet.material;
    part.positions = {{sheet.x0, sheet.y0, sheet.z},
                      {sheet.x1, sheet.y0, sheet.z},
                      {sheet.x1, sheet.y1, sheet.z},
                      {sheet.x0, sheet.y1, sheet.z}};
    part.indices = {0, 1, 2, 0, 2, 3};
  }
  return scene;
}

VoxelizeOptions ids_in_cells(std::array<int, 3> dims) {
  VoxelizeOptions options;
  options.placement.voxel_size = {1.0, 1.0, 1.0};
  options.placement.bounds = {0, 0, 0, double(dims[0]), double(dims[1]), double(dims[2])};
  options.channels = ChannelSet{.material = true, .coverage = true};
  return options;
}

struct Measured {
  int material = -1, coverage = -1;
};

std::map<std::array<int, 3>, Measured> measured(const Scene& scene,
                                                const VoxelizeOptions& options) {
  Voxelizer voxelizer;
  const Grid grid = voxelized(voxelizer, scene, options);
  std::map<std::array<int, 3>, Measured> cells;
  for (const SparseTile& tile : grid.tiles) {
    EXPECT_EQ(tile.material.size(), tile.voxel_count());
    EXPECT_EQ(tile.coverage.size(), tile.voxel_count());
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      cells[{x, y, z}] = {tile.material[voxel], tile.coverage[voxel]};
    });
  }
  return cells;
}

TEST(Ids, the_material_with_the_largest_area_wins_whatever_the_order_of_parts) {
  // The second material covers 3/4 of cell 1,1,1 in two pieces, the first 1/2 above it.
  std::vector<Sheet> all = {{1, 1, 1.5, 2, 1.8, 0},
                            {1, 1, 1.5, 2, 1.2, 1},
                            {1.5, 1, 1.75, 2, 1.4, 1},
                            {3, 1, 4, 2, 1.5, -1}};
  for (int round = 0; round < 4; ++round) {
    std::rotate(all.begin(), all.begin() + 1, all.end());
    const auto cells = measured(sheets(all, 2), ids_in_cells({5, 3, 3}));
    EXPECT_EQ(cells.at({1, 1, 1}).material, 2);
    EXPECT_EQ(cells.at({3, 1, 1}).material, 0) << "of no material";
    EXPECT_EQ(cells.at({1, 1, 1}).coverage, 255) << "5/4 of a face";
    EXPECT_EQ(cells.at({3, 1, 1}).coverage, 255);
  }
}

TEST(Ids, equal_areas_give_the_smaller_id_and_no_material_is_the_smallest) {
  const auto tie = [](int a, int b) {
    const Scene scene = sheets({{1, 1, 2, 2, 1.3, a}, {1, 1, 2, 2, 1.6, b}}, 3);
    return measured(scene, ids_in_cells({3, 3, 3})).at({1, 1, 1}).material;
  };
  EXPECT_EQ(tie(0, 2), 1);
  EXPECT_EQ(tie(2, 0), 1);
  EXPECT_EQ(tie(1, -1), 0);
  EXPECT_EQ(tie(2, 2), 3);
}

TEST(Ids, do_not_depend_on_how_a_surface_is_cut_into_triangles) {
  std::vector<Sheet> cut;
  for (int i = 0; i < 8; ++i) cut.push_back({i / 8.0, 0, (i + 1) / 8.0, 0.75, 0.5, 1});
  cut.push_back({0, 0, 1, 0.5, 0.25, 0});
  const Scene whole = sheets({{0, 0, 1, 0.75, 0.5, 1}, {0, 0, 1, 0.5, 0.25, 0}}, 2);
  const auto a = measured(whole, ids_in_cells({2, 2, 2}));
  const auto b = measured(sheets(cut, 2), ids_in_cells({2, 2, 2}));
  EXPECT_EQ(a.at({0, 0, 0}).material, 2);
  EXPECT_EQ(b.at({0, 0, 0}).material, 2);
  EXPECT_EQ(a.at({0, 0, 0}).coverage, b.at({0, 0, 0}).coverage);
}

TEST(Coverage, is_the_area_in_a_voxel_over_that_of_its_face) {
  const Scene scene = sheets({{0.5, 0, 4, 4, 0.5, 0}}, 1);
  const auto cells = measured(scene, ids_in_cells({4, 4, 2}));
  EXPECT_EQ(cells.at({0, 1, 0}).coverage, 128);  // half of 16 points
  EXPECT_EQ(cells.at({2, 1, 0}).coverage, 255);
  EXPECT_FALSE(cells.contains({2, 1, 1}));
  // A square at 45 degrees has the area of its projection times sqrt(2).
  Scene slope = sheets({{0, 0, 4, 4, 0, 0}}, 1);
  for (auto& p : slope.parts[0].positions) p.z = p.x;
  const auto steep = measured(slope, ids_in_cells({4, 4, 4}));
  int sum = 0;
  for (const auto& [cell, one] : steep) sum += cell[1] == 2 ? one.coverage : 0;
  EXPECT_GE(sum, 4 * 255);
  EXPECT_LE(sum, 4 * 361);
}

TEST(Ids, more_materials_than_ids_are_refused) {
  Scene scene = sheets({{0, 0, 1, 1, 0.5, 65535}}, 65536);
  Voxelizer voxelizer;
  const auto refused = voxelizer.voxelize(scene, ids_in_cells({2, 2, 2}), {}, nullptr);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidOption);
  EXPECT_EQ(refused.error().message(),
            "channels: material: too many materials: expected at most 65535, got 65536");
  scene.materials.pop_back();
  scene.parts[0].material = 65534;
  EXPECT_EQ(measured(scene, ids_in_cells({2, 2, 2})).at({0, 0, 0}).material, 65535);
}

// The definition again: each material's surface voxelized alone, by the sums that coverage shows.
TEST(Ids, are_those_of_the_largest_coverage_of_each_material_alone) {
  std::mt19937 random(4);
  std::vector<Sheet> all;
  for (int i = 0; i < 60; ++i) {
    const auto at = [&](int below) { return static_cast<double>(random() % unsigned(below)) / 8; };
    const double x = at(64), y = at(64);
    all.push_back({x, y, x + 0.125 + at(6), y + 0.125 + at(6), at(8) / 2 + 0.06, i % 3});
  }
  const VoxelizeOptions options = ids_in_cells({10, 10, 1});
  const auto together = measured(sheets(all, 3), options);
  std::array<std::map<std::array<int, 3>, Measured>, 3> alone;
  for (int material = 0; material < 3; ++material) {
    std::vector<Sheet> one;
    std::ranges::copy_if(all, std::back_inserter(one),
                         [&](const Sheet& sheet) { return sheet.material == material; });
    alone[static_cast<size_t>(material)] = measured(sheets(one, 3), options);
  }
  int compared = 0;
  for (const auto& [cell, got] : together) {
    int best = -1, id = 0;
    bool is_clear = true;
    for (int material = 0; material < 3; ++material) {
      const auto found = alone[static_cast<size_t>(material)].find(cell);
      if (found == alone[static_cast<size_t>(material)].end()) continue;
      const int coverage = found->second.coverage;
      is_clear = is_clear && coverage < 255 && coverage != best;
      if (coverage > best) {
        best = coverage;
        id = material + 1;
      }
    }
    if (!is_clear) continue;
    ++compared;
    EXPECT_EQ(got.material, id) << cell[0] << ' ' << cell[1];
  }
  EXPECT_GT(compared, 20);
}

TEST(DominantColor, is_that_of_the_material_with_the_largest_area_alone) {
  // Red and green of one material cover cell 0,0,0; blue of another covers a part or all of it.
  const auto color_of = [](double blue, ColorMode mode) {
    Scene scene =
        sheets({{0, 0, 0.5, 1, 0.25, 0}, {0.5, 0, 1, 1, 0.25, 0}, {0, 0, blue, 1, 0.5, 1}}, 2);
    const std::array<glm::vec4, 3> colors = {glm::vec4(1, 0, 0, 1), glm::vec4(0, 1, 0, 1),
                                             glm::vec4(0, 0, 1, 1)};
    for (size_t p = 0; p < 3; ++p) scene.parts[p].colors.assign(4, colors[p]);
    VoxelizeOptions options = ids_in_cells({1, 1, 1});
    options.channels->color = true;
    options.color = mode;
    Voxelizer voxelizer;
    const Grid grid = voxelized(voxelizer, scene, options);
    EXPECT_EQ(grid.tiles[0].coverage, std::vector<uint8_t>{255});
    return grid.tiles[0].color;
  };
  using Color = std::vector<uint8_t>;
  // Snapped, red is 128 sub-voxels wide and green 127: the far side of the grid stays inside.
  const Color expected = {188, 187, 0, 255};
  EXPECT_EQ(color_of(0.75, ColorMode::kDominant), expected);
  EXPECT_EQ(color_of(1.0, ColorMode::kDominant), expected) << "the first of two";
  EXPECT_NE(color_of(0.75, ColorMode::kAverage), expected);
}

}  // namespace
}  // namespace voxeld
