// The whole way from scene to grid without a GL context: what needs no other pipeline to compare
// with. tests/gpu/voxel holds cpu against raster and compute.
#include "server/voxel/voxelize.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <random>
#include <string>

#include <glm/geometric.hpp>

#include "server/grid/color_tables.h"

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
  options.channels_given = options.channel_color = options.channel_normal = true;
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
  options.channel_color = options.channel_normal = false;
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
    EXPECT_EQ(grid.error().code, ErrorCode::kDeviceUnavailable);
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

}  // namespace
}  // namespace voxeld
