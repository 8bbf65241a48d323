// Properties of Renderer besides hits: blocks and cancelling, backgrounds, errors, big grids.
#include "server/render/render.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/gpu/objects.h"
#include "shaders/shared/raymarch.h"
#include "tests/gpu/render/test_grids.h"
#include "tests/gpu/render/test_renderer.h"

namespace voxeld {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

RenderOptions small_options() {
  RenderOptions options;
  options.width = options.height = 32;
  return options;
}

std::array<uint8_t, 4> pixel(const RenderImage& image, int x, int y) {
  const size_t i = size_t{4} * static_cast<size_t>(y * image.width + x);
  return {image.rgba[i], image.rgba[i + 1], image.rgba[i + 2], image.rgba[i + 3]};
}

TEST(Renderer, an_empty_grid_gives_the_background_alone) {
  const auto made = make_test_renderer();
  Renderer& renderer = *made;
  RenderOptions options = small_options();
  options.background = {10, 200, 30, 255};
  const auto before = renderer.render(options, {});
  ASSERT_TRUE(before.ok()) << before.error().message();
  EXPECT_THAT(pixel(*before, 16, 16), ElementsAre(10, 200, 30, 255));
  Grid grid;
  grid.spec.dims = {100, 3, 50};
  ASSERT_TRUE(renderer.set_grid(grid).ok());
  options.background = {0, 0, 0, 0};
  const auto image = renderer.render(options, {});
  ASSERT_TRUE(image.ok()) << image.error().message();
  EXPECT_THAT(image->rgba, Each(0));
}

TEST(Renderer, half_transparent_backgrounds_keep_their_colour_and_alpha) {
  const auto made = make_test_renderer();
  Renderer& renderer = *made;
  ASSERT_TRUE(renderer.set_grid(sphere_grid(16, false, false)).ok());
  RenderOptions options = small_options();
  options.background = {200, 100, 50, 128};
  const auto image = renderer.render(options, {});
  ASSERT_TRUE(image.ok());
  EXPECT_THAT(pixel(*image, 0, 0), ElementsAre(200, 100, 50, 128));
  EXPECT_EQ(pixel(*image, 16, 16)[3], 255);
}

TEST(Renderer, colours_come_out_as_they_are_stored_where_the_light_is_full) {
  GridSpec spec;
  spec.dims = {4, 1, 4};
  const auto made = make_test_renderer();
  Renderer& renderer = *made;
  ASSERT_TRUE(renderer
                  .set_grid(make_test_grid(spec, true, false,
                                           [](const glm::ivec3& c) {
                                             const auto r = static_cast<uint8_t>(60 * c.x);
                                             const auto b = static_cast<uint8_t>(60 * c.z);
                                             return TestVoxel{{r, 128, b, 255}, {}};
                                           }))
                  .ok());
  RenderOptions options = small_options();
  options.light = Light::kFlat;  // tops are drawn at full brightness
  // From above, x to the right, z down.
  options.matrix = {0.5, 0, 0, -1, 0, 0, -0.5, 1, 0, -0.1, 0, 0, 0, 0, 0, 1};
  const auto image = renderer.render(options, {});
  ASSERT_TRUE(image.ok());
  for (int z = 0; z < 4; ++z) {
    for (int x = 0; x < 4; ++x) {
      const auto got = pixel(*image, 8 * x + 4, 8 * z + 4);
      // One level: linear light in between rounds.
      EXPECT_NEAR(got[0], 60 * x, 1);
      EXPECT_NEAR(got[1], 128, 1);
      EXPECT_NEAR(got[2], 60 * z, 1);
    }
  }
}

TEST(Renderer, the_cut_face_shows_the_voxel_that_the_plane_passes) {
  GridSpec spec;
  spec.dims = {8, 8, 8};
  const auto made = make_test_renderer();
  Renderer& renderer = *made;
  const auto block = [](const glm::ivec3& c) {
    return TestVoxel{{0, static_cast<uint8_t>(30 * c.z), 255, 255}, {}};
  };
  ASSERT_TRUE(renderer.set_grid(make_test_grid(spec, true, false, block)).ok());
  RenderOptions options = small_options();
  options.azimuth_deg = options.elevation_deg = 0;
  options.light = Light::kFlat;
  options.section = {0, 0, 1, -3.5};
  const auto hits = renderer.render_hits(options);
  ASSERT_TRUE(hits.ok());
  const Hit middle = (*hits)[16 * 32 + 16];
  EXPECT_EQ(middle.cell.z, 3);
  EXPECT_EQ(middle.face, 5);
  const auto image = renderer.render(options, {});
  ASSERT_TRUE(image.ok());
  // +z faces are drawn at 0.64 of full brightness: sRGB 90 becomes 72, 255 becomes 210.
  const auto got = pixel(*image, 16, 16);
  EXPECT_NEAR(got[1], 72, 2);
  EXPECT_NEAR(got[2], 210, 2);
}

TEST(Renderer, images_are_drawn_in_blocks_and_can_be_cancelled_between_them) {
  const auto made = make_test_renderer();
  Renderer& renderer = *made;
  ASSERT_TRUE(renderer.set_grid(sphere_grid(16, false, false)).ok());
  RenderOptions options;
  options.width = 1025;
  options.height = 600;
  std::vector<int64_t> done;
  const auto whole = renderer.render(options, [&](int64_t blocks_done, int64_t blocks_total) {
    EXPECT_EQ(blocks_total, 6);
    done.push_back(blocks_done);
    return true;
  });
  ASSERT_TRUE(whole.ok()) << whole.error().message();
  EXPECT_THAT(done, ElementsAre(1, 2, 3, 4, 5, 6));
  const auto cancelled =
      renderer.render(options, [](int64_t blocks_done, int64_t) { return blocks_done < 2; });
  ASSERT_FALSE(cancelled.ok());
  EXPECT_EQ(cancelled.error().code, ErrorCode::kCancelled);
  // The seams between blocks do not show.
  const auto again = renderer.render(options, {});
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(again->rgba, whole->rgba);
}

TEST(Renderer, a_singular_matrix_is_an_invalid_option) {
  const auto made = make_test_renderer();
  Renderer& renderer = *made;
  RenderOptions options = small_options();
  options.matrix.emplace();
  const auto image = renderer.render(options, {});
  ASSERT_FALSE(image.ok());
  EXPECT_EQ(image.error().code, ErrorCode::kInvalidOption);
  EXPECT_EQ(image.error().message(),
            "matrix cannot be inverted: expected an invertible clip_from_world of moderate "
            "numbers, got a singular matrix");
}

TEST(Renderer, a_grid_of_1024_cells_a_side_renders) {
  GridSpec spec;
  spec.dims = glm::ivec3(1024);
  // A plate and a column: millions of voxels without a test of a billion cells.
  const auto at = [](const glm::ivec3& c) {
    const bool on = c.y == 5 || (c.x / 8 == 64 && c.z / 8 == 64 && c.y < 1000);
    return on ? std::optional(TestVoxel{{255, 255, 255, 255}, {}}) : std::nullopt;
  };
  Grid grid;
  grid.spec = spec;
  grid.channels.color = true;
  for (int x = 0; x < 4; ++x) {
    for (int z = 0; z < 4; ++z) {
      GridSpec layer;  // the lowest eight cells of one column of tiles
      layer.dims = {256, 8, 256};
      Grid part = make_test_grid(layer, true, false, [&](const glm::ivec3& c) {
        return at({c.x + 256 * x, c.y, c.z + 256 * z});
      });
      part.tiles[0].coord = {x, 0, z};
      grid.tiles.push_back(std::move(part.tiles[0]));
    }
  }
  EXPECT_GT(grid.voxel_count(), 1'000'000u);
  const auto made = make_test_renderer();
  Renderer& renderer = *made;
  const Status uploaded = renderer.set_grid(grid);
  ASSERT_TRUE(uploaded.ok()) << uploaded.error().message();
  RenderOptions options = small_options();
  options.elevation_deg = 90;
  options.projection = Projection::kOrthographic;
  const auto hits = renderer.render_hits(options);
  ASSERT_TRUE(hits.ok()) << hits.error().message();
  EXPECT_EQ((*hits)[16 * 32 + 8].cell.y, 5);
  EXPECT_EQ((*hits)[16 * 32 + 8].face, 3);
}

TEST(RaymarchParams, lie_where_the_driver_puts_them) {
  if (test_device_is_cpu()) GTEST_SKIP() << "there is no driver to ask on device cpu";
  using shared::RaymarchParams;
  const struct {
    const char* name;
    size_t offset;
  } kMembers[] = {
      {"params.near_0", offsetof(RaymarchParams, near_0)},
      {"params.near_y", offsetof(RaymarchParams, near_y)},
      {"params.far_0", offsetof(RaymarchParams, far_0)},
      {"params.section", offsetof(RaymarchParams, section)},
      {"params.near_0_low", offsetof(RaymarchParams, near_0_low)},
      {"params.section_low", offsetof(RaymarchParams, section_low)},
      {"params.voxel_size", offsetof(RaymarchParams, voxel_size)},
      {"params.light_world", offsetof(RaymarchParams, light_world)},
      {"params.background", offsetof(RaymarchParams, background)},
      {"params.full_color", offsetof(RaymarchParams, full_color)},
      {"params.footprint", offsetof(RaymarchParams, footprint)},
      {"params.box_low", offsetof(RaymarchParams, box_low)},
      {"params.box_high", offsetof(RaymarchParams, box_high)},
      {"params.tile_dims", offsetof(RaymarchParams, tile_dims)},
      {"params.image", offsetof(RaymarchParams, image)},
  };
  const auto program = test_shaders().get(
      {{"raymarch.vert"}, {"raymarch.frag"}},
      {{"RAYMARCH_ATTRIBUTES", "1"}, {"RAYMARCH_SMOOTH", "1"}, {"RAYMARCH_LIGHT", "1"}});
  ASSERT_TRUE(program.ok()) << program.error().message();
  const gpu::GlApi& gl = gpu::test_context().gl();
  for (const auto& member : kMembers) {
    const GLuint index = gl.GetProgramResourceIndex((*program)->id(), GL_UNIFORM, member.name);
    ASSERT_NE(index, GL_INVALID_INDEX) << member.name;
    const GLenum property = GL_OFFSET;
    GLint offset = -1;
    gl.GetProgramResourceiv((*program)->id(), GL_UNIFORM, index, 1, &property, 1, nullptr, &offset);
    EXPECT_EQ(static_cast<size_t>(offset), member.offset) << member.name;
  }
}

}  // namespace
}  // namespace voxeld
