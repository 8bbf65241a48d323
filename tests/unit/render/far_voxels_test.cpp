// Voxels that are so small in the image that many are drawn as one.
#include <gtest/gtest.h>

#include <cstdint>

#include "server/render/cpu/cpu_renderer.h"

namespace voxeld {
namespace {

TEST(FarVoxels, a_block_of_full_bricks_alone_has_the_colour_of_full_voxels) {
  Grid grid;
  grid.spec.dims = glm::ivec3(1024);
  grid.channels.color = true;
  SparseTile full;
  for (uint32_t block = 0; block < 512; ++block) full.full.push_back({block * 64, 0});
  SparseTile red;
  red.coord = {3, 3, 3};
  red.brick_morton = {0};
  red.masks.resize(1);
  red.masks[0].words[0] = 1;
  red.color = {255, 0, 10, 255};
  grid.tiles = {full, red};
  RenderOptions options;
  options.width = options.height = 16;
  options.style = Style::kSmooth;
  options.occlusion = options.shadow = options.ground = false;
  CpuRenderer renderer;
  ASSERT_TRUE(renderer.set_grid(grid).ok());
  const auto image = renderer.render(options, {});
  ASSERT_TRUE(image.ok()) << image.error().message();
  int red_pixels = 0;
  for (size_t i = 0; i < image->rgba.size(); i += 4) {
    EXPECT_GT(image->rgba[i], 80) << i / 4;  // of the red, or of the white background
    red_pixels += image->rgba[i + 1] < 80 ? 1 : 0;
  }
  EXPECT_GT(red_pixels, 0);
}

}  // namespace
}  // namespace voxeld
