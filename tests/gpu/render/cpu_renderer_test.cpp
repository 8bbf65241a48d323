// The ray march on the CPU against the GL context's: one text, so the same hits but for rounding.
#include <gtest/gtest.h>

#include <cstdlib>

#include "server/render/packed_grid.h"
#include "server/render/raymarch_params.h"
#include "server/render/silhouette.h"
#include "tests/gpu/render/test_grids.h"
#include "tests/gpu/render/test_renderer.h"

namespace voxeld {
namespace {

// Rays that may hit another cell because a driver rounds a division differently; what is measured
// on the software drivers is 0.
constexpr double kOtherHitsMax = 0.001;
// Levels of 255: pow() of a driver and of the C library.
constexpr int kRoundingLevelMax = 2;

struct Scene {
  const char* name;
  Grid grid;
  RenderOptions options;
};

// A box of 64^3 cells full to the middle of its height, a coloured shell of single voxels above.
Grid full_nodes_grid() {
  GridSpec spec;
  spec.dims = {64, 64, 64};
  Grid grid =
      make_test_grid(spec, true, false, [](const glm::ivec3& c) -> std::optional<TestVoxel> {
        if (c.y < 32 || (c.x + c.z) % 60 > 2) return std::nullopt;
        return TestVoxel{{200, static_cast<uint8_t>(4 * c.x), 20, 255}, {}};
      });
  for (uint32_t block = 0; block < 8; ++block) {
    if ((block & 2) == 0) grid.tiles.front().full.push_back({block * 64, 2});
  }
  return grid;
}

std::vector<Scene> scenes() {
  GridSpec spec;
  spec.dims = {70, 41, 96};
  spec.voxel_size = {1, 0.5, 1};
  const RenderOptions options = plain_options(Style::kSmooth, 150, 90);
  RenderOptions cut = options;
  cut.section = {0.3, 1, 0.2, -32};
  cut.background = {10, 200, 90, 100};
  RenderOptions flat = options;
  flat.style = Style::kIso;
  flat.projection = Projection::kOrthographic;
  flat.elevation_deg = -20;
  RenderOptions lit = options;
  lit.occlusion = lit.shadow = true;
  RenderOptions lit_flat = flat;
  lit_flat.occlusion = true;
  RenderOptions lit_cut = cut;
  lit_cut.section = {0.3, 1, 0.2, -60};
  lit_cut.shadow = true;
  RenderOptions clay_cut = options_in(Style::kClay, 150, 90);
  clay_cut.section = {0.3, 1, 0.2, -32};
  return {{"sphere with colours and normals", sphere_grid(60, true, true), options},
          {"sphere with estimated normals", sphere_grid(90, false, false), options},
          {"noise, cut", noise_grid(spec, 0.05, 3), cut},
          {"coloured, flat light", sphere_grid(40, true, false), flat},
          {"ambient occlusion and shadow", sphere_grid(60, false, false), lit},
          {"the same of colours and normals", sphere_grid(60, true, true), lit},
          {"flat light with ambient occlusion", sphere_grid(40, true, false), lit_flat},
          {"voxels smaller than pixels", sphere_grid(400, true, true), options},
          {"smaller, estimated normals and light", sphere_grid(300, false, false), lit},
          {"full nodes, cut, shadow", full_nodes_grid(), lit_cut},
          {"cubes on the ground", sphere_grid(16, true, true), options_in(Style::kVoxel, 150, 90)},
          {"clay, cut", sphere_grid(60, true, false), clay_cut},
          {"isometric view", sphere_grid(24, true, true), options_in(Style::kIso, 150, 90)},
          {"outlines", sphere_grid(20, true, false), options_in(Style::kBlueprint, 150, 90)},
          {"outlines of small voxels", sphere_grid(90, false, false),
           options_in(Style::kBlueprint, 150, 90)}};
}

TEST(CpuRenderer, hits_the_cells_that_gl_hits) {
  if (test_device_is_cpu()) GTEST_SKIP() << "compared on the GL devices";
  GlRenderer gl(gpu::test_context(), test_shaders());
  CpuRenderer cpu(3);
  for (const Scene& scene : scenes()) {
    SCOPED_TRACE(scene.name);
    ASSERT_TRUE(gl.set_grid(scene.grid).ok());
    ASSERT_TRUE(cpu.set_grid(scene.grid).ok());
    const auto wanted = gl.render_hits(scene.options), got = cpu.render_hits(scene.options);
    ASSERT_TRUE(wanted.ok() && got.ok());
    ASSERT_EQ(wanted->size(), got->size());
    int hits = 0, others = 0;
    for (size_t i = 0; i < got->size(); ++i) {
      hits += (*wanted)[i].face >= 0;
      others += (*wanted)[i].cell != (*got)[i].cell || (*wanted)[i].face != (*got)[i].face;
    }
    EXPECT_GT(hits, 1000);
    EXPECT_LE(others, kOtherHitsMax * static_cast<double>(got->size()));
  }
}

TEST(CpuRenderer, draws_the_image_that_gl_draws) {
  if (test_device_is_cpu()) GTEST_SKIP() << "compared on the GL devices";
  GlRenderer gl(gpu::test_context(), test_shaders());
  CpuRenderer cpu;
  for (const Scene& scene : scenes()) {
    SCOPED_TRACE(scene.name);
    ASSERT_TRUE(gl.set_grid(scene.grid).ok());
    ASSERT_TRUE(cpu.set_grid(scene.grid).ok());
    const auto wanted = gl.render(scene.options, {}), got = cpu.render(scene.options, {});
    ASSERT_TRUE(wanted.ok() && got.ok());
    ASSERT_EQ(wanted->rgba.size(), got->rgba.size());
    size_t others = 0;
    for (size_t i = 0; i < got->rgba.size(); ++i) {
      others += std::abs(wanted->rgba[i] - got->rgba[i]) > kRoundingLevelMax;
    }
    EXPECT_LE(static_cast<double>(others),
              kOtherHitsMax * static_cast<double>(4 * got->rgba.size()));
  }
}

// Cameras of all sorts: the silhouette is no narrower than what a ray hits, and little wider.
TEST(CpuRenderer, nothing_is_seen_outside_the_silhouette) {
  if (!test_device_is_cpu()) GTEST_SKIP() << "once, without a context";
  CpuRenderer cpu;
  std::vector<Scene> all = scenes();
  for (const double zoom : {0.02, 3.0, 60.0}) {
    Scene& scene = all.emplace_back(scenes().front());
    scene.options.zoom = zoom;
    scene.options.elevation_deg = -70;
  }
  // A camera inside the grid, which looks at a part of it alone.
  Scene& inside = all.emplace_back(scenes().front());
  inside.options.matrix = {1, 0, 0, -30, 0, 1, 0, -30, 0, 0, -1.02, 30, 0, 0, -1, 31};
  int compared = 0;
  for (const Scene& scene : all) {
    SCOPED_TRACE(scene.name);
    ASSERT_TRUE(cpu.set_grid(scene.grid).ok());
    const auto hits = cpu.render_hits(scene.options);
    ASSERT_TRUE(hits.ok());
    const auto packed = pack_grid(scene.grid);
    ASSERT_TRUE(packed.ok());
    const Subject subject = subject_of(*packed);
    const int width = scene.options.width, height = scene.options.height;
    const Silhouette silhouette(make_camera(scene.options, subject), subject, width, height);
    int64_t inside_it = 0, found = 0;
    for (int y = 0; y < height; ++y) {
      const auto [first, end] = silhouette.row(y);
      inside_it += end - first;
      for (int x = 0; x < width; ++x) {
        const bool hit = (*hits)[static_cast<size_t>((height - 1 - y) * width + x)].face >= 0;
        found += hit ? 1 : 0;
        ASSERT_TRUE(!hit || (x >= first && x < end))
            << x << ", " << y << ": " << first << " to " << end;
      }
    }
    if (found > 1000 && !scene.options.section && !scene.options.matrix) {
      EXPECT_LT(inside_it, 2 * found);
      ++compared;
    }
  }
  EXPECT_GE(compared, 12);
}

TEST(CpuRenderer, every_instruction_set_draws_the_same_image) {
  if (!test_device_is_cpu()) GTEST_SKIP() << "once, without a context";
  for (Scene& scene : scenes()) {
    for (const int samples : {1, 2}) {
      scene.options.samples = samples;
      std::vector<uint8_t> expected;
      for (const CpuIsa isa : supported_cpu_isas()) {
        CpuRenderer renderer(0, isa);
        ASSERT_TRUE(renderer.set_grid(scene.grid).ok());
        const auto image = renderer.render(scene.options, {});
        ASSERT_TRUE(image.ok());
        if (isa == CpuIsa::kPortable) expected = image->rgba;
        EXPECT_EQ(image->rgba, expected)
            << scene.name << ", " << cpu_isa_name(isa) << ", " << samples;
      }
      ASSERT_FALSE(expected.empty());
    }
  }
}

TEST(CpuRenderer, the_number_of_threads_changes_nothing) {
  if (!test_device_is_cpu()) GTEST_SKIP() << "once, without a context";
  CpuRenderer one(1), many(7);
  for (const Scene& scene : scenes()) {
    ASSERT_TRUE(one.set_grid(scene.grid).ok());
    ASSERT_TRUE(many.set_grid(scene.grid).ok());
    const auto a = one.render(scene.options, {}), b = many.render(scene.options, {});
    ASSERT_TRUE(a.ok() && b.ok());
    EXPECT_EQ(a->rgba, b->rgba) << scene.name;
  }
}

}  // namespace
}  // namespace voxeld
