// The colours of a GIF: few are kept, many are dithered around their mean.
#include "server/render/gif_palette.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <utility>

namespace voxeld {
namespace {

TEST(GifPalette, up_to_256_colours_are_kept) {
  std::vector<uint8_t> rgb;
  for (int i = 0; i < 256 * 3; ++i) {
    const auto level = static_cast<uint8_t>(i * 7);
    rgb.insert(rgb.end(), {level, static_cast<uint8_t>(255 - level), 77});
  }
  const IndexedImage image = reduce_colors(rgb, 16);
  EXPECT_EQ(image.palette.size(), 256u);
  ASSERT_EQ(image.indices.size(), rgb.size() / 3);
  for (size_t i = 0; i < image.indices.size(); ++i) {
    for (size_t c = 0; c < 3; ++c) {
      ASSERT_EQ(image.palette[image.indices[i]][c], rgb[3 * i + c]) << i;
    }
  }
}

TEST(GifPalette, one_pixel_has_one_colour) {
  const std::vector<uint8_t> rgb = {1, 2, 3};
  const IndexedImage image = reduce_colors(rgb, 1);
  ASSERT_EQ(image.palette.size(), 1u);
  EXPECT_EQ(image.palette[0], (std::array<uint8_t, 3>{1, 2, 3}));
}

// Red to the right, green downwards, in 65,536 colours, on a white frame.
std::vector<uint8_t> gradient() {
  std::vector<uint8_t> rgb;
  for (int y = -32; y < 288; ++y) {
    for (int x = -32; x < 288; ++x) {
      const bool is_inside = x >= 0 && x < 256 && y >= 0 && y < 256;
      rgb.push_back(is_inside ? static_cast<uint8_t>(x) : uint8_t{255});
      rgb.push_back(is_inside ? static_cast<uint8_t>(y) : uint8_t{255});
      rgb.push_back(is_inside ? uint8_t{100} : uint8_t{255});
    }
  }
  return rgb;
}

TEST(GifPalette, means_of_a_gradient_are_kept_and_white_stays_white) {
  constexpr int kSide = 320, kBlock = 16;
  const std::vector<uint8_t> rgb = gradient();
  const IndexedImage image = reduce_colors(rgb, kSide);
  EXPECT_EQ(image.palette.size(), 256u);
  const auto at = [&](int x, int y, size_t c) {
    const auto pixel = static_cast<size_t>(y * kSide + x);
    return std::pair<int, int>(rgb[3 * pixel + c], image.palette[image.indices[pixel]][c]);
  };
  double squares = 0.0;
  for (int y = 0; y < kSide; y += kBlock) {
    for (int x = 0; x < kSide; x += kBlock) {
      for (size_t c = 0; c < 3; ++c) {
        int wanted = 0, got = 0;
        for (int i = 0; i < kBlock * kBlock; ++i) {
          const auto [before, after] = at(x + i % kBlock, y + i / kBlock, c);
          wanted += before;
          got += after;
          squares += (before - after) * (before - after);
        }
        // Dithering keeps the mean of 256 pixels within 2 levels, but not at the ends of the
        // gradient, beyond which there is no colour.
        const bool is_inside = x >= 64 && x < 256 && y >= 64 && y < 256;
        if (!is_inside) continue;
        EXPECT_LE(std::abs(wanted - got), 2 * kBlock * kBlock) << x << " " << y << " " << c;
      }
    }
  }
  // 256 boxes of a square of 256 x 256 levels have 16 levels a side: 16 / sqrt(12) = 4.6, and
  // dithering doubles that.
  EXPECT_LT(std::sqrt(squares / (3.0 * kSide * kSide)), 10.0);
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(at(0, 0, c).second, 255);
    EXPECT_EQ(at(kSide - 1, kSide - 1, c).second, 255);
  }
}

// Most pixels are in two cells of the histogram, in each of which red varies around the same mean.
TEST(GifPalette, a_part_that_cannot_be_split_leaves_the_other_colours_to_the_rest) {
  std::vector<uint8_t> rgb;
  for (int i = 0; i < 40'000; ++i) {
    const auto red = static_cast<uint8_t>(240 + 7 * (i % 2));
    const auto green = static_cast<uint8_t>(7 + i / 2 % 2);
    rgb.insert(rgb.end(), {red, green, 0});
  }
  for (int i = 0; i < 400; ++i) {
    const auto red = static_cast<uint8_t>(8 * (i % 20));
    const auto green = static_cast<uint8_t>(8 * (i / 20));
    rgb.insert(rgb.end(), {red, green, 255});
  }
  EXPECT_EQ(reduce_colors(rgb, 100).palette.size(), 256u);
}

}  // namespace
}  // namespace voxeld
