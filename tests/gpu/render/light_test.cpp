// Ambient occlusion, shadows, levels of detail and solids, by what must be so in any image.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include "tests/gpu/render/hits_check.h"
#include "tests/gpu/render/test_grids.h"
#include "tests/gpu/render/test_renderer.h"

namespace voxeld {
namespace {

using ::testing::ElementsAre;

constexpr int kSide = 32;  // of plates, in cells, and of their images, in pixels

RenderImage image_of(const RenderOptions& options) {
  auto image = hits_renderer().render(options, {});
  EXPECT_TRUE(image.ok()) << image.error().message();
  return image.ok() ? std::move(image).value() : RenderImage{};
}

// From above, x to the right, z down; `cells` from side to side, 200 deep.
RenderOptions from_above(int cells, int pixels) {
  RenderOptions options = options_of(pixels, pixels, 0, 0);
  options.style = Style::kIso;
  const double s = 2.0 / cells;
  options.matrix = {s, 0, 0, -1, 0, 0, -s, 1, 0, -0.01, 0, 0.5, 0, 0, 0, 1};
  return options;
}

// A white floor at y = 0 and what `also` adds.
Grid floor_and(const std::function<bool(const glm::ivec3&)>& also) {
  GridSpec spec;
  spec.dims = {kSide, 16, kSide};
  return make_test_grid(spec, true, false, [&](const glm::ivec3& c) {
    return c.y == 0 || also(c) ? std::optional(TestVoxel{{255, 255, 255, 255}, {}}) : std::nullopt;
  });
}

TEST(Occlusion, a_floor_alone_is_open_and_lit_everywhere) {
  ASSERT_TRUE(hits_renderer().set_grid(floor_and([](const auto&) { return false; })).ok());
  for (const Style style : {Style::kIso, Style::kSmooth, Style::kVoxel, Style::kClay}) {
    // One cell to a pixel, and sixteen: smooth surfaces and cubes.
    for (const int cells : {kSide, 2}) {
      RenderOptions options = from_above(cells, kSide);
      options.style = style;
      const RenderImage plain = image_of(options);
      options.occlusion = options.shadow = true;
      EXPECT_EQ(image_of(options).rgba, plain.rgba) << cells;
    }
  }
}

TEST(Occlusion, darkens_a_floor_the_more_the_nearer_it_is_to_a_wall) {
  ASSERT_TRUE(
      hits_renderer().set_grid(floor_and([](const glm::ivec3& c) { return c.x == 0; })).ok());
  RenderOptions options = from_above(kSide, 8 * kSide);
  options.occlusion = true;
  const RenderImage image = image_of(options);
  // In the middle of cells at z = 8, 9, ...
  for (int y = 8 * 8 + 4; y < 8 * 24; y += 8) {
    const auto level = [&](int x) { return pixel(image, 8 * x + 4, y)[0]; };
    EXPECT_LT(level(1), 235) << y;
    EXPECT_GT(level(1), 120) << y;
    EXPECT_LT(level(1), level(2)) << y;
    EXPECT_LT(level(2), level(4)) << y;
    EXPECT_EQ(level(24), 255) << y;
  }
}

TEST(Occlusion, ends_at_the_section_plane) {
  // The wall is cut away, so the floor beside it is open.
  ASSERT_TRUE(
      hits_renderer().set_grid(floor_and([](const glm::ivec3& c) { return c.x == 0; })).ok());
  RenderOptions options = from_above(kSide, 8 * kSide);
  options.occlusion = true;
  options.section = {-1, 0, 0, 1};
  const RenderImage image = image_of(options);
  EXPECT_EQ(pixel(image, 4, 128)[0], 255);  // the cell that was a wall is background
  for (int x = 8; x < 8 * kSide; ++x) EXPECT_EQ(pixel(image, x, 128)[0], 255) << x;
}

TEST(Shadow, falls_away_from_the_light_and_has_a_soft_edge) {
  // A block 10 cells above the floor. The light stands to the viewer's right and above: from here
  // towards +x, -z.
  ASSERT_TRUE(hits_renderer()
                  .set_grid(floor_and([](const glm::ivec3& c) {
                    return c.y == 11 && c.x >= 14 && c.x < 20 && c.z >= 12 && c.z < 18;
                  }))
                  .ok());
  RenderOptions options = from_above(kSide, 4 * kSide);
  const RenderImage plain = image_of(options);
  options.shadow = true;
  const RenderImage image = image_of(options);
  // Its shadow is shifted by 10 cells times 0.45 to the left and 0.65 down, so it shows below the
  // block; flat light keeps 0.6 of 1, sRGB 203.
  EXPECT_EQ(pixel(plain, 4 * 13, 4 * 22)[0], 255);
  EXPECT_NEAR(pixel(image, 4 * 13, 4 * 22)[0], 203, 2);
  EXPECT_EQ(pixel(image, 4 * 24, 4 * 8)[0], 255);
  int between = 0;
  for (int y = 0; y < 4 * kSide; ++y) {
    const uint8_t level = pixel(image, 4 * 13, y)[0];
    between += level > 205 && level < 253;
  }
  EXPECT_GT(between, 1);
  EXPECT_LT(between, 16);
}

TEST(LevelsOfDetail, voxels_far_smaller_than_a_pixel_give_their_mean) {
  GridSpec spec;
  spec.dims = {512, 1, 512};
  const auto checkers = [](const glm::ivec3& c) {
    const auto level = static_cast<uint8_t>((c.x + c.z) % 2 == 0 ? 255 : 0);
    return TestVoxel{{level, level, level, 255}, {}};
  };
  ASSERT_TRUE(hits_renderer().set_grid(make_test_grid(spec, true, false, checkers)).ok());
  // 64, 16, 8 and 4 voxels to a pixel: cubes of 32, 8, 4 and 2.
  for (const int pixels : {8, 32, 64, 128}) {
    const RenderImage image = image_of(from_above(512, pixels));
    for (int y = 0; y < pixels; ++y) {
      for (int x = 0; x < pixels; ++x) {
        ASSERT_NEAR(pixel(image, x, y)[0], 188, 1) << x << "," << y << " of " << pixels;
      }
    }
  }
  // Voxels of a pixel and more are drawn one by one.
  const RenderImage image = image_of(from_above(512, 512));
  for (int x = 0; x < 512; ++x) {
    ASSERT_EQ(pixel(image, x, 100)[0], x % 2 == 0 ? 255 : 0) << x;
  }
}

TEST(FullNodes, are_light_grey_and_cut_open_by_sections) {
  Grid grid;
  grid.spec.dims = glm::ivec3(256);
  grid.channels.color = true;
  SparseTile tile;
  tile.full = {{0, kTileLevels}};
  grid.tiles = {tile};
  ASSERT_TRUE(hits_renderer().set_grid(grid).ok());
  RenderOptions options = from_above(256, kSide);
  options.matrix = {2.0 / 256, 0, 0, -1, 0, 0, -2.0 / 256, 1, 0, -0.002, 0, 0.5, 0, 0, 0, 1};
  EXPECT_THAT(pixel(image_of(options), 16, 16), ElementsAre(214, 205, 192, 255));
  options.section = {0, 1, 0, -100.5};
  // The colour of cuts over the neutral one, between two lines of the hatch.
  EXPECT_THAT(pixel(image_of(options), 16, 16), ElementsAre(222, 185, 162, 255));
  const auto hits = hits_renderer().render_hits(options);
  ASSERT_TRUE(hits.ok());
  EXPECT_EQ((*hits)[16 * kSide + 16].cell.y, 100);
}

TEST(FullNodes, have_the_mean_colour_of_the_voxels_around_them) {
  GridSpec spec;
  spec.dims = glm::ivec3(256);
  Grid grid =
      make_test_grid(spec, true, false, [](const glm::ivec3& c) -> std::optional<TestVoxel> {
        if (c.y != 128) return std::nullopt;
        return TestVoxel{{30, 200, 90, 255}, {}};
      });
  for (uint32_t eighth = 0; eighth < 8; ++eighth) {
    if ((eighth & 2) == 0) grid.tiles.front().full.push_back({eighth * 4096, kTileLevels - 1});
  }
  ASSERT_TRUE(hits_renderer().set_grid(grid).ok());
  RenderOptions options = from_above(256, kSide);
  options.matrix = {2.0 / 256, 0, 0, -1, 0, 0, -2.0 / 256, 1, 0, -0.002, 0, 0.5, 0, 0, 0, 1};
  options.section = {0, 1, 0, -100.5};
  const RenderImage cut = image_of(options);
  const auto got = pixel(cut, 16, 16);
  // 0.55 of it in linear light, and 0.45 of the colour of cuts.
  EXPECT_NEAR(got[0], 163, 1);
  EXPECT_NEAR(got[1], 182, 1);
  EXPECT_NEAR(got[2], 100, 1);
}

}  // namespace
}  // namespace voxeld
