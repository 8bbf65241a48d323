// Properties of Renderer besides hits: blocks and cancelling, backgrounds, errors, big grids.
#include "server/render/render.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vec2.hpp>

#include "server/gpu/objects.h"
#include "shaders/shared/raymarch.h"
#include "tests/gpu/render/test_grids.h"
#include "tests/gpu/render/test_renderer.h"

namespace voxeld {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

RenderOptions small_options() {
  return plain_options(Style::kSmooth, 32, 32);
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
  options.style = Style::kIso;  // tops are drawn at full brightness
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
  options.style = Style::kIso;
  options.section = {0, 0, 1, -3.5};
  const auto hits = renderer.render_hits(options);
  ASSERT_TRUE(hits.ok());
  const Hit middle = (*hits)[16 * 32 + 16];
  EXPECT_EQ(middle.cell.z, 3);
  EXPECT_EQ(middle.face, 5);
  const auto image = renderer.render(options, {});
  ASSERT_TRUE(image.ok());
  // The cut is 0.55 of the voxel's colour, 0 90 255, and the rest of the section's own, 232 156 111
  // in sRGB; +z faces are drawn at 0.64 of full brightness. Lines of the hatch are darker.
  int between = 0, lines = 0;
  for (int x = 8; x < 24; ++x) {
    const auto got = pixel(*image, x, 16);
    const bool is_between =
        std::abs(got[0] - 133) <= 2 && std::abs(got[1] - 102) <= 2 && std::abs(got[2] - 170) <= 2;
    between += is_between;
    lines += !is_between && got[0] < 125;
  }
  EXPECT_GT(between, 4);
  EXPECT_GT(lines, 1);
}

// The share of the smaller side of the image that differs from the transparent background, and
// whether it touches the image's edge.
struct Silhouette {
  double share = 0;
  bool is_clipped = false;
};
Silhouette silhouette(const RenderImage& image) {
  glm::ivec2 low(image.width, image.height), high(0);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (pixel(image, x, y)[3] == 0) continue;
      low = glm::min(low, glm::ivec2(x, y));
      high = glm::max(high, glm::ivec2(x + 1, y + 1));
    }
  }
  const glm::dvec2 size(image.width, image.height);
  const glm::dvec2 share = glm::dvec2(high - low) / size;
  return {std::max(share.x, share.y),
          low.x == 0 || low.y == 0 || high.x == image.width || high.y == image.height};
}

TEST(Renderer, voxels_fill_the_frame_from_every_side_and_none_is_clipped) {
  // Two bars across each other: their box is mostly empty.
  GridSpec spec;
  spec.dims = {40, 24, 300};
  spec.voxel_size = {1, 2, 0.5};
  const Grid bars =
      make_test_grid(spec, false, false, [](const glm::ivec3& c) -> std::optional<TestVoxel> {
        const bool is_on = (c.x == c.z / 8 && c.y < 3) || (c.z == 20 && c.x == 5);
        return is_on ? std::optional(TestVoxel{}) : std::nullopt;
      });
  const auto renderer = make_test_renderer();
  for (const Grid& grid : {bars, sphere_grid(30, false, false)}) {
    ASSERT_TRUE(renderer->set_grid(grid).ok());
    for (int view = 0; view < 24; ++view) {
      RenderOptions options = plain_options(Style::kIso, view % 3 == 0 ? 200 : 100, 100);
      options.background = {0, 0, 0, 0};
      options.projection = view % 2 == 0 ? Projection::kPerspective : Projection::kOrthographic;
      options.azimuth_deg = 57.0 * view;
      options.elevation_deg = -90.0 + 7.8 * view;
      const auto image = renderer->render(options, {});
      ASSERT_TRUE(image.ok()) << image.error().message();
      const Silhouette seen = silhouette(*image);
      EXPECT_GE(seen.share, 0.85) << view;
      EXPECT_FALSE(seen.is_clipped) << view;
    }
  }
}

TEST(Renderer, the_ground_darkens_the_background_on_the_side_away_from_the_light_and_fades_out) {
  const auto renderer = make_test_renderer();
  ASSERT_TRUE(renderer->set_grid(sphere_grid(24, false, false)).ok());
  RenderOptions options = plain_options(Style::kClay, 120, 120);
  options.zoom = 0.4;
  const auto without = renderer->render(options, {});
  options.ground = true;
  const auto image = renderer->render(options, {});
  ASSERT_TRUE(without.ok() && image.ok());
  const auto darker = [&](int x, int y) {
    return pixel(*without, x, y)[1] - pixel(*image, x, y)[1];
  };
  // Beside the sphere's foot: the light comes over the viewer's right shoulder.
  EXPECT_GT(darker(40, 68), 10);
  EXPECT_LT(darker(90, 68), 3);
  for (int i = 0; i < 120; ++i) {
    for (const auto& [x, y] : {std::pair{i, 0}, {i, 119}, {0, i}, {119, i}}) {
      EXPECT_EQ(darker(x, y), 0) << x << "," << y;
    }
  }
  // Seen from below there is none.
  options.elevation_deg = -20;
  const auto below = renderer->render(options, {});
  options.ground = false;
  EXPECT_EQ(below->rgba, renderer->render(options, {})->rgba);
}

TEST(Renderer, dark_colours_are_brighter_and_white_stays_white) {
  GridSpec spec;
  spec.dims = {2, 1, 8};
  const auto grid_of = [&](uint8_t level) {
    return make_test_grid(spec, true, false, [=](const glm::ivec3& c) {
      const uint8_t own = c.z == 0 ? 255 : level;
      return TestVoxel{{own, own, own, 255}, {}};
    });
  };
  const auto renderer = make_test_renderer();
  RenderOptions options = plain_options(Style::kSmooth, 16, 16);
  options.matrix = {1, 0, 0, -1, 0, 0, -0.25, 1, 0, -0.1, 0, 0, 0, 0, 0, 1};  // from above
  const auto levels = [&](std::optional<double> exposure) {
    options.exposure = exposure;
    const auto image = renderer->render(options, {});
    EXPECT_TRUE(image.ok());
    return std::pair{pixel(*image, 8, 1)[0], pixel(*image, 8, 11)[0]};
  };
  ASSERT_TRUE(renderer->set_grid(grid_of(40)).ok());
  const auto [white, dark] = levels(1.0);
  const auto [white_after, dark_after] = levels({});
  EXPECT_EQ(white_after, white);
  EXPECT_GT(dark_after, dark + 25);
  EXPECT_GT(levels(8.0).second, dark_after);
  // A model that is bright already stays as it is.
  ASSERT_TRUE(renderer->set_grid(grid_of(180)).ok());
  EXPECT_EQ(levels({}), levels(1.0));
}

TEST(Renderer, a_blueprint_has_lines_and_nothing_between_them) {
  GridSpec spec;
  spec.dims = {4, 4, 4};
  const auto renderer = make_test_renderer();
  ASSERT_TRUE(renderer
                  ->set_grid(make_test_grid(spec, true, false,
                                            [](const glm::ivec3&) {
                                              return TestVoxel{{200, 10, 10, 255}, {}};
                                            }))
                  .ok());
  RenderOptions options = options_in(Style::kBlueprint, 101, 101);
  options.background = {0, 0, 0, 0};
  options.azimuth_deg = options.elevation_deg = 0;
  const auto image = renderer->render(options, {});
  ASSERT_TRUE(image.ok()) << image.error().message();
  // One square: 46.5 pixels to each side of the middle. Its voxels lie in one plane.
  int lines = 0;
  for (int x = 0; x < 101; ++x) {
    const uint8_t alpha = pixel(*image, x, 30)[3];
    if (alpha == 0) continue;
    ++lines;
    EXPECT_NEAR(std::abs(x + 0.5 - 50.5), 46.5, 2.0) << x;
  }
  EXPECT_GE(lines, 2);
  EXPECT_LE(lines, 8);
  EXPECT_EQ(pixel(*image, 50, 50)[3], 0);
}

TEST(Renderer, images_are_drawn_in_blocks_and_can_be_cancelled_between_them) {
  const auto made = make_test_renderer();
  Renderer& renderer = *made;
  ASSERT_TRUE(renderer.set_grid(sphere_grid(16, false, false)).ok());
  const RenderOptions options = plain_options(Style::kSmooth, 1025, 600);
  int64_t done = 0, total = 0;
  const auto whole = renderer.render(options, [&](int64_t blocks_done, int64_t blocks_total) {
    EXPECT_EQ(blocks_done, ++done);
    total = blocks_total;
    return true;
  });
  ASSERT_TRUE(whole.ok()) << whole.error().message();
  EXPECT_GE(total, 6);
  EXPECT_EQ(done, total);
  const auto cancelled =
      renderer.render(options, [](int64_t blocks_done, int64_t) { return blocks_done < 2; });
  ASSERT_FALSE(cancelled.ok());
  EXPECT_EQ(cancelled.error().code, ErrorCode::kCancelled);
  // The seams between blocks do not show.
  const auto again = renderer.render(options, {});
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(again->rgba, whole->rgba);
}

TEST(Renderer, a_draw_of_gl_has_fewer_pixels_where_they_have_many_rays) {
  if (test_device_is_cpu()) GTEST_SKIP() << "the CPU can be interrupted within a block";
  const auto renderer = make_test_renderer();
  ASSERT_TRUE(renderer->set_grid(sphere_grid(16, false, false)).ok());
  const auto blocks_of = [&](RenderOptions options, int samples) {
    options.samples = samples;
    int64_t blocks = 0;
    const auto image = renderer->render(options, [&](int64_t, int64_t blocks_total) {
      blocks = blocks_total;
      return false;  // the first one suffices
    });
    EXPECT_FALSE(image.ok());
    return blocks;
  };
  EXPECT_EQ(blocks_of(plain_options(Style::kSmooth, 512, 512), 1), 1);
  EXPECT_GE(blocks_of(options_in(Style::kVoxel, 512, 512), 4), 2);
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
      {"params.background_top", offsetof(RaymarchParams, background_top)},
      {"params.line", offsetof(RaymarchParams, line)},
      {"params.full_color", offsetof(RaymarchParams, full_color)},
      {"params.footprint", offsetof(RaymarchParams, footprint)},
      {"params.tone", offsetof(RaymarchParams, tone)},
      {"params.ground", offsetof(RaymarchParams, ground)},
      {"params.box_low", offsetof(RaymarchParams, box_low)},
      {"params.box_high", offsetof(RaymarchParams, box_high)},
      {"params.tile_dims", offsetof(RaymarchParams, tile_dims)},
      {"params.image", offsetof(RaymarchParams, image)},
  };
  const auto program =
      test_shaders().get({{"raymarch.vert"}, {"raymarch.frag"}}, {{"RAYMARCH_ATTRIBUTES", "1"},
                                                                  {"RAYMARCH_SMOOTH", "1"},
                                                                  {"RAYMARCH_LIGHT", "1"},
                                                                  {"RAYMARCH_GROUND", "1"},
                                                                  {"RAYMARCH_OUTLINE", "0"}});
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
