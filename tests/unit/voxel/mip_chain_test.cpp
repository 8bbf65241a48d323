#include "server/voxel/attributes/mip_chain.h"

#include <gtest/gtest.h>

#include <array>

#include "server/grid/color/color_tables.h"

namespace voxeld {
namespace {

Image image_of(int width, int height, std::vector<uint8_t> rgba) {
  Image image;
  image.width = width;
  image.height = height;
  image.rgba = std::move(rgba);
  return image;
}

TEST(MipChain, halves_down_to_one_texel) {
  EXPECT_EQ(level_count(1, 1), 1);
  EXPECT_EQ(level_count(256, 3), 9);
  EXPECT_EQ(level_count(5, 7), 3);
  const auto levels =
      build_mip_levels(image_of(5, 3, std::vector<uint8_t>(60, 77)), 0, level_count(5, 3) - 1);
  ASSERT_EQ(levels.size(), 3u);
  EXPECT_EQ(levels[1].width, 2);
  EXPECT_EQ(levels[1].height, 1);
  EXPECT_EQ(levels[2].width, 1);
}

TEST(MipChain, an_even_colour_is_unchanged) {
  for (const int side : {2, 3, 7, 64, 100}) {
    std::vector<uint8_t> rgba;
    for (int i = 0; i < side * side; ++i) rgba.insert(rgba.end(), {3, 77, 200, 129});
    const int last = level_count(side, side) - 1;
    const auto levels = build_mip_levels(image_of(side, side, rgba), 1, last);
    ASSERT_EQ(levels.size(), static_cast<size_t>(last));
    for (const MipLevel& level : levels) {
      EXPECT_FALSE(level.rgba.empty());
      for (size_t i = 0; i < level.rgba.size(); i += 4) {
        EXPECT_EQ(level.rgba[i], 3);
        EXPECT_EQ(level.rgba[i + 1], 77);
        EXPECT_EQ(level.rgba[i + 2], 200);
        EXPECT_EQ(level.rgba[i + 3], 129);
      }
    }
  }
}

TEST(MipChain, averages_light_not_bytes) {
  const auto levels = build_mip_levels(image_of(2, 1, {0, 0, 0, 255, 255, 255, 255, 255}), 1, 1);
  EXPECT_EQ(levels[0].rgba, (std::vector<uint8_t>{188, 188, 188, 255}));
}

TEST(MipChain, weighs_colours_by_alpha_unless_all_are_transparent) {
  EXPECT_EQ(build_mip_levels(image_of(2, 1, {0, 0, 0, 0, 9, 200, 3, 255}), 1, 1)[0].rgba,
            (std::vector<uint8_t>{9, 200, 3, 128}));
  // Three quarters of white: linear 0.75 is sRGB 225.
  EXPECT_EQ(build_mip_levels(image_of(2, 1, {0, 0, 0, 30, 255, 255, 255, 90}), 1, 1)[0].rgba,
            (std::vector<uint8_t>{225, 225, 225, 60}));
  EXPECT_EQ(build_mip_levels(image_of(2, 1, {0, 0, 0, 0, 255, 255, 255, 0}), 1, 1)[0].rgba,
            (std::vector<uint8_t>{188, 188, 188, 0}));
}

TEST(MipChain, odd_sides_weigh_texels_by_the_part_that_is_covered) {
  // Five texels over two: the third is shared.
  std::vector<uint8_t> rgba;
  for (const uint8_t v : std::array<uint8_t, 5>{0, 0, 255, 0, 0})
    rgba.insert(rgba.end(), {v, v, v, v});
  const auto levels = build_mip_levels(image_of(5, 1, rgba), 1, 2);
  // 0.5 of 2.5 texels.
  EXPECT_EQ(levels[0].rgba[3], 51);
  EXPECT_EQ(levels[0].rgba[7], 51);
  EXPECT_EQ(levels[0].rgba[0], levels[0].rgba[4]);
  EXPECT_EQ(levels[1].rgba[3], 51);
}

TEST(ColorTables, are_inverse_of_each_other) {
  for (size_t i = 0; i < 256; ++i) {
    EXPECT_EQ(srgb8_from_linear16()[linear16_from_srgb8()[i]], i);
  }
  EXPECT_EQ(linear16_from_srgb8()[255], 65535u);
  EXPECT_EQ(linear16_from_srgb8()[188], 32957u);
}

}  // namespace
}  // namespace voxeld
