#include "server/formats/palette.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <random>

#include "server/base/cancel_point.h"

namespace voxeld {
namespace {

uint32_t key_of(int r, int g, int b) {
  return static_cast<uint32_t>(r | g << 8 | b << 16);
}
Rgb rgb_of(uint32_t key) {
  return {static_cast<uint8_t>(key), static_cast<uint8_t>(key >> 8),
          static_cast<uint8_t>(key >> 16)};
}

// Largest difference of a channel between a colour and the palette's for it.
int error_of(const Palette& palette, uint32_t key) {
  const Rgb want = rgb_of(key), got = palette.colors.at(palette.index_of.at(key));
  int error = 0;
  for (size_t c = 0; c < 3; ++c) error = std::max(error, std::abs(want[c] - got[c]));
  return error;
}

// CIE L*a*b* of an sRGB colour under D65 (CIE 15:2004): another perceptual space than the one that
// the palette is made in.
std::array<double, 3> lab_of(const Rgb& color) {
  std::array<double, 3> linear{};
  for (size_t c = 0; c < 3; ++c) {
    const double s = color[c] / 255.0;
    linear[c] = s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
  }
  const auto f = [](double t) {
    return t > 216.0 / 24389 ? std::cbrt(t) : t * 841 / 108 + 4.0 / 29;
  };
  const auto& [r, g, b] = linear;
  const double x = f((0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.9505);
  const double y = f(0.2126 * r + 0.7152 * g + 0.0722 * b);
  const double z = f((0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.089);
  return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}
double lab_distance2(const Rgb& a, const Rgb& b) {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c) sum += std::pow(lab_of(a)[c] - lab_of(b)[c], 2);
  return sum;
}

ColorCounts cube(int steps, uint64_t count = 1) {
  ColorCounts counts;
  const auto level = [&](int i) { return i * 255 / (steps - 1); };
  for (int r = 0; r < steps; ++r) {
    for (int g = 0; g < steps; ++g) {
      for (int b = 0; b < steps; ++b) counts[key_of(level(r), level(g), level(b))] = count;
    }
  }
  return counts;
}

TEST(Palette, is_exact_up_to_the_number_of_colours_that_it_may_have) {
  std::mt19937 random(1);
  ColorCounts counts;
  while (counts.size() < 255) counts[random() & 0xffffff] = 1 + random() % 1000;
  const Palette palette = make_palette(counts, 255);
  EXPECT_EQ(palette.colors.size(), 255u);
  for (const auto& [key, count] : counts) EXPECT_EQ(error_of(palette, key), 0);
  counts[0x1000000 - 1] = 1;
  EXPECT_LE(make_palette(counts, 255).colors.size(), 255u);
}

TEST(Palette, one_colour_more_than_fits_costs_little) {
  ColorCounts counts;
  for (int grey = 0; grey < 256; ++grey) counts[key_of(grey, grey, grey)] = 1;
  const Palette palette = make_palette(counts, 255);
  EXPECT_EQ(palette.colors.size(), 255u);
  for (const auto& [key, count] : counts) EXPECT_LE(error_of(palette, key), 2) << key;
}

TEST(Palette, errors_of_many_colours_are_bounded) {
  // A cube of 4913 colours. The uniform palette of 6 x 6 x 6 colours has a mean of 19 levels and at
  // most 26; perceived distance gives dark colours more room in sRGB (measured: 22.7 and 88).
  const ColorCounts counts = cube(17);
  const Palette palette = make_palette(counts, 255);
  double sum = 0;
  int largest = 0;
  for (const auto& [key, count] : counts) {
    const int error = error_of(palette, key);
    sum += error;
    largest = std::max(largest, error);
  }
  EXPECT_LT(sum / static_cast<double>(counts.size()), 25);
  EXPECT_LT(largest, 100);
}

TEST(Palette, is_nearer_to_the_eye_than_a_uniform_palette_of_about_its_size) {
  const ColorCounts counts = cube(17);
  const Palette palette = make_palette(counts, 216);
  double ours = 0, uniform = 0;
  for (const auto& [key, count] : counts) {
    const Rgb color = rgb_of(key);
    Rgb web{};
    for (size_t c = 0; c < 3; ++c) web[c] = static_cast<uint8_t>((color[c] + 25) / 51 * 51);
    ours += lab_distance2(color, palette.colors.at(palette.index_of.at(key)));
    uniform += lab_distance2(color, web);
  }
  EXPECT_LT(ours, 0.75 * uniform) << ours / uniform;
}

TEST(Palette, a_colour_that_most_voxels_have_is_nearly_exact) {
  ColorCounts counts = cube(12);
  const uint32_t most = key_of(101, 57, 203);
  counts[most] = 1'000'000;
  const Palette palette = make_palette(counts, 64);
  EXPECT_LE(error_of(palette, most), 1);
}

TEST(Palette, every_colour_has_an_entry_for_every_size_of_the_palette) {
  const ColorCounts counts = cube(9);
  for (const int size : {1, 2, 3, 100, 254, 255}) {
    const Palette palette = make_palette(counts, size);
    EXPECT_GE(palette.colors.size(), 1u);
    EXPECT_LE(palette.colors.size(), static_cast<size_t>(size));
    EXPECT_EQ(palette.index_of.size(), counts.size());
    for (const auto& [key, index] : palette.index_of) {
      EXPECT_LT(index, palette.colors.size());
      EXPECT_TRUE(counts.contains(key));
    }
  }
}

TEST(Palette, a_single_entry_is_the_mean_in_linear_light) {
  const ColorCounts counts = {{key_of(0, 0, 0), 1}, {key_of(255, 255, 255), 1}};
  // Half of the light is sRGB 188, not 128.
  EXPECT_EQ(make_palette(counts, 1).colors, (std::vector<Rgb>{{188, 188, 188}}));
}

TEST(Palette, depends_on_the_counts_alone_not_on_their_order) {
  std::mt19937 random(2);
  ColorCounts drawn;
  while (drawn.size() < 3000) drawn[random() & 0xffffff] = 1 + random() % 50;
  std::vector<std::pair<uint32_t, uint64_t>> list(drawn.begin(), drawn.end());
  std::ranges::sort(list);
  const ColorCounts first(list.begin(), list.end());
  std::ranges::shuffle(list, random);
  ColorCounts second(1 << 16);  // other buckets, other order
  second.insert(list.begin(), list.end());
  const Palette a = make_palette(first, 100), b = make_palette(second, 100);
  EXPECT_EQ(a.colors, b.colors);
  EXPECT_EQ(a.index_of, b.index_of);
}

TEST(Palette, a_cancelled_task_ends) {
  const ColorCounts counts = cube(9);
  const std::atomic<bool> flag{true};
  const CancelScope scope(flag);
  EXPECT_THROW((void)make_palette(counts, 255), Cancelled);
}

TEST(Palette, of_nothing_is_empty) {
  const Palette palette = make_palette({}, 255);
  EXPECT_TRUE(palette.colors.empty());
  EXPECT_TRUE(palette.index_of.empty());
}

}  // namespace
}  // namespace voxeld
