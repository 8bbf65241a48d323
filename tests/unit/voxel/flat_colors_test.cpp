#include "server/voxel/attributes/flat_colors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "server/voxel/attributes/attribute_records.h"

namespace voxeld {
namespace {

using Linear = std::array<uint16_t, 4>;

Image plain_image(int width, int height, const std::array<uint8_t, 4>& color) {
  Image image{"image", width, height, {}};
  for (int i = 0; i < width * height; ++i) {
    image.rgba.insert(image.rgba.end(), color.begin(), color.end());
  }
  return image;
}

void set_texel(Image& image, int x, int y, const std::array<uint8_t, 4>& color) {
  for (size_t c = 0; c < 4; ++c) {
    image.rgba[4 * static_cast<size_t>(y * image.width + x) + c] = color[c];
  }
}

std::array<FlatCorner, 3> corners_at(glm::dvec2 a, glm::dvec2 b, glm::dvec2 c) {
  return {{{a, glm::dvec4(1.0)}, {b, glm::dvec4(1.0)}, {c, glm::dvec4(1.0)}}};
}

TEST(FlatColors, without_a_texture_it_is_the_mean_of_the_corners) {
  std::array<FlatCorner, 3> corners;
  corners[0].color = {1, 0, 0, 1};
  corners[1].color = {0, 1, 0, 1};
  corners[2].color = {0.5, 0.5, 3, 0.25};  // 3 is taken as 1
  EXPECT_EQ(mean_color(corners, nullptr, nullptr), (Linear{32768, 32768, 21845, 49151}));
}

TEST(FlatColors, an_even_texture_is_multiplied_by_its_alpha_under_any_triangle) {
  const Image image = plain_image(37, 20, {255, 0, 255, 51});
  for (const Wrap wrap : {Wrap::kRepeat, Wrap::kClamp, Wrap::kMirror}) {
    Material material;
    material.wrap_u = material.wrap_v = wrap;
    for (const double scale : {0.0, 0.01, 1.0, 90.0, 1e30}) {
      const auto corners = corners_at({-scale, 0.1}, {scale, 0.4 * scale}, {0.3, -scale});
      EXPECT_EQ(mean_color(corners, &material, &image), (Linear{13107, 0, 13107, 13107}));
    }
  }
}

TEST(FlatColors, texels_beside_the_triangle_have_no_share) {
  Image image = plain_image(64, 64, {255, 255, 255, 255});
  const Material material;
  for (int y = 16; y < 32; ++y) {
    for (int x = 16; x < 32; ++x) set_texel(image, x, y, {0, 0, 0, 255});
  }
  const auto at = [](double texel) { return texel / 64; };
  const auto corners = corners_at({at(16.5), at(16.5)}, {at(31.5), at(16.5)}, {at(16.5), at(31.5)});
  EXPECT_EQ(mean_color(corners, &material, &image), (Linear{0, 0, 0, 65535}));
}

TEST(FlatColors, a_triangle_within_a_period_has_nothing_of_the_opposite_side) {
  Image image = plain_image(4, 4, {0, 0, 0, 255});
  for (int y = 0; y < 4; ++y) set_texel(image, 0, y, {255, 255, 255, 255});
  const Material material;
  for (const double at : {0.0, 5.0, -3.0}) {
    const auto last = corners_at({at + 0.9, 0.1}, {at + 1.0, 0.1}, {at + 1.0, 0.2});
    EXPECT_EQ(mean_color(last, &material, &image), (Linear{0, 0, 0, 65535})) << at;
    const auto over = corners_at({at + 0.9, 0.1}, {at + 1.1, 0.1}, {at + 1.1, 0.2});
    EXPECT_GT(mean_color(over, &material, &image)[0], 1000) << at;
  }
}

TEST(FlatColors, the_order_of_corners_does_not_change_a_bit) {
  Image image = plain_image(16, 16, {0, 0, 0, 255});
  for (size_t i = 0; i < image.rgba.size(); ++i) image.rgba[i] = static_cast<uint8_t>(i * i % 251);
  const Material material;
  std::array<FlatCorner, 3> corners = corners_at({0.11, 0.23}, {0.71, 0.37}, {0.41, 0.93});
  corners[1].color = {0.3, 0.7, 0.1, 0.9};
  const Linear expected = mean_color(corners, &material, &image);
  for (const std::array<size_t, 3> order :
       {std::array<size_t, 3>{0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}}) {
    EXPECT_EQ(
        mean_color({corners[order[0]], corners[order[1]], corners[order[2]]}, &material, &image),
        expected);
  }
}

TEST(FlatColors, nan_counts_as_0) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Image image = plain_image(4, 4, {255, 255, 255, 255});
  const Material material;
  auto corners = corners_at({nan, 0.5}, {0.5, nan}, {nan, nan});
  EXPECT_EQ(mean_color(corners, &material, &image), (Linear{65535, 65535, 65535, 65535}));
  corners[0].color = corners[1].color = corners[2].color = glm::dvec4(nan, 1.0, 1.0, 1.0);
  EXPECT_EQ(mean_color(corners, &material, &image), (Linear{0, 65535, 65535, 65535}));
}

TEST(OneCellWeight, is_the_area_of_a_triangle_whose_corners_share_a_cell) {
  const auto weight = [](glm::ivec3 a, glm::ivec3 b, glm::ivec3 c) {
    return one_cell_weight({a, b, c});
  };
  // A face of 256^2 has 4096.
  EXPECT_EQ(weight({0, 0, 9}, {128, 0, 9}, {0, 128, 9}), 512u);
  EXPECT_EQ(weight({-256, 512, 0}, {-128, 512, 0}, {-256, 512, 128}), 512u);
  EXPECT_EQ(weight({7, 7, 7}, {7, 7, 7}, {9, 9, 9}), 1u);    // no area
  EXPECT_EQ(weight({0, 0, 0}, {256, 0, 0}, {0, 9, 0}), 0u);  // two cells
  EXPECT_EQ(weight({0, 0, 0}, {-1, 0, 0}, {0, 9, 0}), 0u);
}

}  // namespace
}  // namespace voxeld
