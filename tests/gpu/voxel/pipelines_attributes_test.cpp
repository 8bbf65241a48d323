// Colours and normals whose values are known.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/gpu/voxel/pipelines.h"
#include "tests/unit/long_form.h"

namespace voxeld::pipelines {
namespace {

using Color = std::array<int, 4>;
using Normal = std::array<int, 3>;

VoxelizeOptions with_normals(VoxelizeOptions options) {
  options.channels = ChannelSet{.color = true, .normal = true};
  return options;
}

// A square of `side` voxels at z = 0.5, u along x and v along -y over the whole of it.
Scene textured_square(double side, Image image, double repeat = 1.0) {
  MeshPart part;
  add_quad(part, {glm::dvec3(0, 0, 0.5), {side, 0, 0.5}, {side, side, 0.5}, {0, side, 0.5}});
  const auto r = static_cast<float>(repeat);
  part.uvs = {{0, r}, {r, r}, {r, 0}, {0, 0}};
  part.material = 0;
  Scene scene = scene_of(std::move(part));
  scene.materials.emplace_back();
  scene.materials[0].image = 0;
  scene.images.push_back(std::move(image));
  return scene;
}

template <typename ColorAt>
Image image_of(int width, int height, const ColorAt& color_at) {
  Image image;
  image.width = width;
  image.height = height;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (const int c : color_at(x, y)) image.rgba.push_back(static_cast<uint8_t>(c));
    }
  }
  return image;
}

TEST(Attributes, a_mesh_without_colours_gets_no_colour_channel) {
  MeshPart part;
  add_box(part, {1, 1, 1}, {7, 7, 7});
  const Scene scene = scene_of(part);
  EXPECT_FALSE(voxelize_all(scene, unit_cells({8, 8, 8})).channels.color);
  VoxelizeOptions options = unit_cells({8, 8, 8});
  options.color = ColorMode::kShaded;
  EXPECT_TRUE(voxelize_all(scene, options).channels.color);
}

TEST(Attributes, normals_of_a_box_point_outwards) {
  MeshPart part;
  add_box(part, {1.5, 1.5, 1.5}, {6.5, 6.5, 6.5});
  const Cells cells = cells_of(voxelize_all(scene_of(part), with_normals(unit_cells({8, 8, 8}))));
  EXPECT_EQ(cells.at({4, 4, 1}).normal, (Normal{0, 0, -127}));
  EXPECT_EQ(cells.at({4, 4, 6}).normal, (Normal{0, 0, 127}));
  EXPECT_EQ(cells.at({1, 4, 4}).normal, (Normal{-127, 0, 0}));
  EXPECT_EQ(cells.at({4, 6, 4}).normal, (Normal{0, 127, 0}));
  // 127 / sqrt(3) on each axis.
  EXPECT_EQ(cells.at({6, 6, 6}).normal, (Normal{73, 73, 73}));
}

TEST(Attributes, a_mirroring_transform_keeps_normals_outwards) {
  MeshPart part;
  add_box(part, {1.5, 1.5, 1.5}, {6.5, 6.5, 6.5});
  VoxelizeOptions options = with_normals(unit_cells({8, 8, 8}));
  options.placement.transform = {-1, 0, 0, 8, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  const Cells cells = cells_of(voxelize_all(scene_of(part), options));
  EXPECT_EQ(cells.at({1, 4, 4}).normal, (Normal{-127, 0, 0}));
  EXPECT_EQ(cells.at({4, 4, 6}).normal, (Normal{0, 0, 127}));
}

TEST(Attributes, the_base_colour_is_exact_to_the_last_bit) {
  MeshPart part;
  add_box(part, {1, 1, 1}, {7, 7, 7});
  part.material = 0;
  Scene scene = scene_of(part);
  scene.colors_given = true;
  scene.materials.emplace_back();
  // sRGB 200, 100, 50.
  scene.materials[0].base_color = {0.5775804f, 0.1274377f, 0.0318960f, 0.5f};
  const Cells cells = cells_of(voxelize_all(scene, unit_cells({8, 8, 8})));
  ASSERT_FALSE(cells.empty());
  for (const auto& [cell, voxel] : cells) {
    EXPECT_EQ(voxel.color, (Color{200, 100, 50, 128}));
  }
}

TEST(Attributes, axis_colours_show_the_dominant_axis) {
  MeshPart part;
  add_box(part, {1.5, 1.5, 1.5}, {6.5, 6.5, 6.5});
  VoxelizeOptions options = unit_cells({8, 8, 8});
  options.color = ColorMode::kAxis;
  const Cells cells = cells_of(voxelize_all(scene_of(part), options));
  EXPECT_EQ(cells.at({1, 4, 4}).color, (Color{255, 0, 0, 255}));
  EXPECT_EQ(cells.at({4, 1, 4}).color, (Color{0, 255, 0, 255}));
  EXPECT_EQ(cells.at({4, 4, 1}).color, (Color{0, 0, 255, 255}));
}

TEST(Attributes, shaded_colours_follow_phongs_formula) {
  MeshPart part;
  add_box(part, {1.5, 1.5, 1.5}, {6.5, 6.5, 6.5});
  VoxelizeOptions options = unit_cells({8, 8, 8});
  options.color = ColorMode::kShaded;
  const Cells cells = cells_of(voxelize_all(scene_of(part), options));
  const auto srgb = [](double linear) {
    return static_cast<int>(255 * (1.055 * std::pow(linear, 1 / 2.4) - 0.055) + 0.5);
  };
  // White; n.l = 1/3, 2/3, 2/3 on the sides that see the light, else ambient light alone.
  const double front_mirror = 2 * (2.0 / 3) - 2.0 / 3;
  EXPECT_EQ(cells.at({4, 4, 6}).color[0],
            srgb(0.2 + 0.8 * 2 / 3 + 0.25 * std::pow(front_mirror, 16)));
  EXPECT_EQ(cells.at({4, 6, 4}).color[0], srgb(0.2 + 0.8 * 2 / 3));
  EXPECT_EQ(cells.at({6, 4, 4}).color[0], srgb(0.2 + 0.8 / 3));
  EXPECT_EQ(cells.at({4, 4, 1}).color[0], srgb(0.2));
  EXPECT_EQ(cells.at({4, 1, 4}).color[0], srgb(0.2));
}

TEST(Attributes, a_texel_per_voxel_is_copied) {
  const auto color_at = [](int x, int y) { return Color{10 * x, 10 * y, 255 - 5 * x, 255}; };
  Scene scene = textured_square(16, image_of(16, 16, color_at));
  scene.materials[0].wrap_u = scene.materials[0].wrap_v = Wrap::kClamp;
  const Cells cells = cells_of(voxelize_all(scene, unit_cells({16, 16, 1})));
  ASSERT_EQ(cells.size(), 256u);
  for (const auto& [cell, voxel] : cells) {
    // On the diagonal each triangle's half is sampled at its own mean.
    if (cell[0] == cell[1]) continue;
    const Color expected = color_at(cell[0], 15 - cell[1]);
    // Snapping moves the square by 1/512 of a voxel, and the dark end of sRGB is steep.
    for (size_t c = 0; c < 4; ++c) EXPECT_NEAR(voxel.color[c], expected[c], 4) << cell[0];
  }
}

TEST(Attributes, a_fine_checkerboard_averages_in_linear_light) {
  const auto checker = [](int x, int y) {
    const int v = ((x ^ y) & 1) != 0 ? 255 : 0;
    return Color{v, v, v, 255};
  };
  for (const int side : {512, 500}) {
    const Cells cells = cells_of(
        voxelize_all(textured_square(8, image_of(side, side, checker)), unit_cells({8, 8, 1})));
    ASSERT_EQ(cells.size(), 64u);
    for (const auto& [cell, voxel] : cells) {
      // Half of the light is sRGB 188.
      EXPECT_NEAR(voxel.color[0], 188, 1) << side << " at " << cell[0] << ", " << cell[1];
    }
  }
}

TEST(Attributes, textures_of_any_size_and_wrapping_are_the_same_in_all_pipelines) {
  const auto color_at = [](int x, int y) {
    return Color{(37 * x + 11 * y) & 255, (x * y) & 255, (5 * x) & 255, (255 - 3 * y) & 255};
  };
  using Size = std::pair<int, int>;
  for (const Wrap wrap : {Wrap::kRepeat, Wrap::kClamp, Wrap::kMirror}) {
    for (const auto& [width, height] :
         by_form<Size>({{1, 1}, {200, 131}}, {{1, 1}, {3, 5}, {64, 7}, {200, 131}})) {
      Scene scene = textured_square(40, image_of(width, height, color_at), 2.7);
      scene.materials[0].wrap_u = scene.materials[0].wrap_v = wrap;
      scene.parts[0].uvs[0] += glm::vec2(-3.3f, 0.4f);
      voxelize_all(scene, unit_cells({40, 40, 1}), std::to_string(width));
    }
  }
}

TEST(Attributes, each_part_takes_its_own_texture) {
  const auto red = [](int, int) { return Color{255, 0, 0, 255}; };
  const auto green = [](int, int) { return Color{0, 255, 0, 255}; };
  Scene scene = textured_square(8, image_of(4, 4, red));
  Scene other = textured_square(8, image_of(4, 4, green));
  MeshPart plain;  // no texture: white
  add_quad(plain, {glm::dvec3(0, 0, 4.5), {8, 0, 4.5}, {8, 8, 4.5}, {0, 8, 4.5}});
  for (glm::dvec3& p : other.parts[0].positions) p.z = 2.5;
  other.parts[0].material = 1;
  scene.parts.insert(scene.parts.begin(), other.parts[0]);
  scene.parts.push_back(plain);
  scene.images.push_back(other.images[0]);
  scene.materials.push_back(scene.materials[0]);
  scene.materials[1].image = 1;
  const Cells cells = cells_of(voxelize_all(scene, unit_cells({8, 8, 5})));
  EXPECT_EQ(cells.at({3, 3, 0}).color, (Color{255, 0, 0, 255}));
  EXPECT_EQ(cells.at({3, 3, 2}).color, (Color{0, 255, 0, 255}));
  EXPECT_EQ(cells.at({3, 3, 4}).color, (Color{255, 255, 255, 255}));
}

TEST(Attributes, texture_factor_and_vertex_colour_multiply) {
  const auto gray = [](int, int) { return Color{188, 255, 188, 255}; };
  Scene scene = textured_square(8, image_of(2, 2, gray));
  scene.materials[0].base_color = {1.0f, 0.5f, 0.5f, 1.0f};
  scene.parts[0].colors.assign(4, glm::vec4(1.0f, 1.0f, 0.5f, 1.0f));
  const Cells cells = cells_of(voxelize_all(scene, unit_cells({8, 8, 1})));
  ASSERT_EQ(cells.size(), 64u);
  for (const auto& [cell, voxel] : cells) {
    EXPECT_NEAR(voxel.color[0], 188, 1);  // 1/2
    EXPECT_NEAR(voxel.color[1], 188, 1);  // 1/2
    EXPECT_NEAR(voxel.color[2], 99, 1);   // 1/8
  }
}

TEST(Attributes, colours_are_weighted_by_area) {
  // Cell 0 is crossed by a whole white square and a quarter of a black one.
  MeshPart part;
  add_quad(part, {glm::dvec3(0, 0, 0.25), {1, 0, 0.25}, {1, 1, 0.25}, {0, 1, 0.25}});
  add_quad(part, {glm::dvec3(0, 0, 0.75), {0.5, 0, 0.75}, {0.5, 0.5, 0.75}, {0, 0.5, 0.75}});
  part.colors.assign(4, glm::vec4(1.0f));
  part.colors.resize(8, glm::vec4(0.0f, 0.0f, 0.0f, 1.0f));
  const Cells cells = cells_of(voxelize_all(scene_of(part), unit_cells({1, 1, 1})));
  // 0.8 of the light is sRGB 231.
  EXPECT_NEAR(cells.at({0, 0, 0}).color[0], 231, 1);
}

TEST(Attributes, sums_beyond_32_bits_carry) {
  // 40 white squares in one layer: 40 * 4096 * 65535 is above 2^33.
  MeshPart part;
  for (int i = 0; i < 40; ++i) {
    add_quad(part, {glm::dvec3(0, 0, 0.5), {8, 0, 0.5}, {8, 8, 0.5}, {0, 8, 0.5}});
  }
  part.colors.assign(part.positions.size(), glm::vec4(1.0f, 1.0f, 1.0f, 1.0f));
  const Cells cells = cells_of(voxelize_all(scene_of(part), with_normals(unit_cells({8, 8, 1}))));
  ASSERT_EQ(cells.size(), 64u);
  for (const auto& [cell, voxel] : cells) {
    EXPECT_EQ(voxel.color, (Color{255, 255, 255, 255}));
    EXPECT_EQ(voxel.normal, (Normal{0, 0, 127}));
  }
}

TEST(Attributes, a_thin_wire_takes_its_colour_from_along_its_length) {
  MeshPart part;
  add_triangle(part, {0, 0.5, 0.5}, {32, 0.5, 0.5}, {32, 0.52, 0.5});
  part.colors = {{1, 0, 0, 1}, {0, 0, 1, 1}, {0, 0, 1, 1}};
  const Cells cells = cells_of(voxelize_all(scene_of(part), unit_cells({32, 1, 1})));
  ASSERT_EQ(cells.size(), 32u);
  EXPECT_GT(cells.at({2, 0, 0}).color[0], 240);
  EXPECT_LT(cells.at({2, 0, 0}).color[2], 90);
  EXPECT_NEAR(cells.at({15, 0, 0}).color[0], 188, 4);
  EXPECT_GT(cells.at({29, 0, 0}).color[2], 240);
}

// The CPU finds these colours; devices make the other channels.
TEST(Attributes, colours_of_nearest_points_are_the_same_by_each_pipeline) {
  Scene scene = soup(21, {.count = 600, .extent = 40, .colors = true});
  VoxelizeOptions options = unit_cells({40, 40, 40});
  options.color = ColorMode::kNearest;
  const Grid alone = voxelize_all(scene, options, "colour alone");
  EXPECT_TRUE(alone.channels.color);
  options = with_normals(options);
  options.channels->coverage = true;
  const Grid nearest = voxelize_all(scene, options, "with normals");
  EXPECT_EQ(nearest.tiles[0].color, alone.tiles[0].color);
  options.color = ColorMode::kAverage;
  const Grid average = voxelize(scene, options, PipelineChoice::kCpu);
  EXPECT_EQ(average.tiles[0].normal, nearest.tiles[0].normal);
  EXPECT_EQ(average.tiles[0].coverage, nearest.tiles[0].coverage);
  EXPECT_NE(average.tiles[0].color, nearest.tiles[0].color);
}

TEST(Attributes, textures_at_nearest_points_are_the_same_by_each_pipeline) {
  const auto color_at = [](int x, int y) { return Color{9 * x, 255 - 7 * y, 40, 255 - 3 * x}; };
  Scene scene = textured_square(24, image_of(24, 24, color_at));
  scene.materials[0].wrap_u = scene.materials[0].wrap_v = Wrap::kClamp;
  VoxelizeOptions options = unit_cells({24, 24, 1});
  options.color = ColorMode::kNearest;
  const Cells cells = cells_of(voxelize_all(scene, options));
  ASSERT_EQ(cells.size(), 576u);
  for (const auto& [cell, voxel] : cells) {
    // A texel's centre lies over the voxel's: snapping moves it by 1/512 at most.
    const Color expected = color_at(cell[0], 23 - cell[1]);
    for (size_t c = 0; c < 4; ++c) EXPECT_NEAR(voxel.color[c], expected[c], 4) << cell[0];
  }
}

// Triangles of four materials, and of none, all over the same cells.
TEST(Attributes, ids_and_coverage_are_the_same_by_each_pipeline) {
  std::mt19937 random(12);
  Scene scene;
  scene.materials.resize(4);
  for (int p = 0; p < 9; ++p) {
    MeshPart& part = scene.parts.emplace_back();
    part.material = p % 5 - 1;
    for (uint32_t i = 0; i < 90; ++i) {
      const auto at = [&] { return static_cast<double>(random() % 4000) / 100; };
      part.positions.emplace_back(at(), at(), at());
      part.indices.push_back(i);
    }
  }
  VoxelizeOptions options = unit_cells({40, 40, 40});
  options.channels = ChannelSet{.material = true, .coverage = true};
  const Grid grid = voxelize_all(scene, options);
  ASSERT_EQ(grid.tiles.size(), 1u);
  std::array<size_t, 5> counts{};
  for (const uint16_t id : grid.tiles[0].material) ++counts.at(id);
  for (const size_t count : counts) EXPECT_GT(count, 500u);
  options.channels->normal = true;
  EXPECT_EQ(voxelize_all(scene, options).tiles[0].material, grid.tiles[0].material);
  for (MeshPart& part : scene.parts) {
    for (size_t i = 0; i < part.positions.size(); ++i) {
      part.colors.emplace_back(float(random() % 256) / 255, float(i % 3) / 2, 0.5f, 1.0f);
    }
  }
  options.channels->color = true;
  options.color = ColorMode::kDominant;
  const Grid dominant = voxelize_all(scene, options);
  EXPECT_EQ(dominant.tiles[0].material, grid.tiles[0].material);
  options.color = ColorMode::kAverage;
  EXPECT_NE(voxelize(scene, options, PipelineChoice::kCpu).tiles[0].color, dominant.tiles[0].color);
  std::ranges::reverse(scene.parts);
  EXPECT_EQ(voxelize(scene, options, PipelineChoice::kCompute).tiles[0].material,
            grid.tiles[0].material);
}

}  // namespace
}  // namespace voxeld::pipelines
