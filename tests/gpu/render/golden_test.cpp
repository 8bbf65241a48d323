// Small images against stored ones. VOXELD_UPDATE_GOLDEN=1 renews them (look at each before it is
// committed); on failure the actual and the difference are written to the build folder.
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "tests/folders.h"
#include "tests/gpu/render/test_grids.h"
#include "tests/gpu/render/test_renderer.h"

namespace voxeld {
namespace {

// Levels of 255. One of the four samples of a pixel at an edge may fall on the other side of it on
// another driver: a quarter of full contrast, more in sRGB's dark part.
constexpr int kGoldenLevelMax = 96;
// Levels, over all pixels and channels: allows 30 such pixels of 4096; a light or a colour that is
// off by 1% of full brightness exceeds it. Mesa's three software drivers give 0.
constexpr double kMeanMax = 0.3;

// In the working directory, which ctest sets to a folder of the build.
const std::filesystem::path kOutDir = "golden";

std::optional<RenderImage> read_image(const std::filesystem::path& path) {
  const auto input = OIIO::ImageInput::open(path.string());
  if (input == nullptr) return std::nullopt;
  RenderImage image;
  image.width = input->spec().width;
  image.height = input->spec().height;
  image.rgba.resize(size_t{4} * image.width * image.height);
  // Straight alpha must come back as it was stored.
  OIIO::ImageSpec config;
  config.attribute("oiio:UnassociatedAlpha", 1);
  const auto straight = OIIO::ImageInput::open(path.string(), &config);
  if (!straight->read_image(0, 0, 0, 4, OIIO::TypeDesc::UINT8, image.rgba.data())) {
    return std::nullopt;
  }
  return image;
}

void write_image(const std::filesystem::path& path, const RenderImage& image) {
  std::filesystem::create_directories(path.parent_path());
  const auto png = encode_png(image);
  ASSERT_TRUE(png.ok()) << png.error().message();
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(png->data()), static_cast<std::streamsize>(png->size()));
}

void expect_golden(const std::string& name, const RenderImage& actual) {
  const std::filesystem::path golden_path =
      test::source_dir() / "tests/gpu/render/golden" / (name + ".png");
  const char* update = std::getenv("VOXELD_UPDATE_GOLDEN");
  if (update != nullptr && std::string_view(update) == "1") {
    write_image(golden_path, actual);
    return;
  }
  const auto golden = read_image(golden_path);
  ASSERT_TRUE(golden.has_value()) << golden_path;
  ASSERT_EQ(golden->width, actual.width);
  ASSERT_EQ(golden->height, actual.height);
  RenderImage difference = actual;
  int level_max = 0;
  double sum = 0;
  for (size_t i = 0; i < actual.rgba.size(); ++i) {
    const int level = std::abs(actual.rgba[i] - golden->rgba[i]);
    level_max = std::max(level_max, level);
    sum += level;
    difference.rgba[i] = i % 4 == 3 ? 255 : static_cast<uint8_t>(std::min(255, 8 * level));
  }
  const double mean = sum / static_cast<double>(actual.rgba.size());
  if (level_max <= kGoldenLevelMax && mean <= kMeanMax) return;
  const std::string device =
      test_device_is_cpu() ? "cpu" : gpu::device_name(gpu::test_context().info().device);
  const auto actual_path = kOutDir / (name + "." + device + ".actual.png");
  write_image(actual_path, actual);
  write_image(kOutDir / (name + "." + device + ".difference.png"), difference);
  ADD_FAILURE() << name << ": max " << level_max << " (limit " << kGoldenLevelMax << "), mean "
                << mean << " (limit " << kMeanMax << "), see " << actual_path;
}

struct GoldenCase {
  const char* name;
  Grid (*grid)();
  void (*adjust)(RenderOptions&);
};

Grid colored_sphere() {
  return sphere_grid(24, true, false);
}
Grid coarse_sphere() {
  return sphere_grid(9, true, false);
}
Grid smooth_sphere() {
  return sphere_grid(24, true, true);
}
Grid plain_sphere() {
  return sphere_grid(48, false, false);
}
Grid few_voxels() {
  GridSpec spec;
  spec.dims = {3, 3, 3};
  spec.voxel_size = {1.0, 0.5, 2.0};
  return make_test_grid(spec, true, false, [](const glm::ivec3& c) -> std::optional<TestVoxel> {
    if ((c.x + c.y + c.z) % 2 != 0) return std::nullopt;
    const auto level = [](int i) { return static_cast<uint8_t>(60 + 90 * i); };
    return TestVoxel{{level(c.x), level(c.y), level(c.z), 255}, {}};
  });
}

// A floor, a wall and a pillar.
Grid corner_with_pillar() {
  GridSpec spec;
  spec.dims = {12, 8, 12};
  return make_test_grid(spec, true, false, [](const glm::ivec3& c) -> std::optional<TestVoxel> {
    const bool is_pillar = c.x == 7 && c.z == 7 && c.y < 5;
    if (c.y != 0 && c.z != 0 && !is_pillar) return std::nullopt;
    return TestVoxel{{200, 200, static_cast<uint8_t>(is_pillar ? 90 : 200), 255}, {}};
  });
}

const GoldenCase kCases[] = {
    {"flat_colored_sphere", colored_sphere, [](RenderOptions& o) { o.style = Style::kIso; }},
    {"phong_estimated_normals", plain_sphere, [](RenderOptions&) {}},
    {"phong_stored_normals", smooth_sphere, [](RenderOptions& o) { o.azimuth_deg = 200; }},
    {"orthographic_transparent", few_voxels,
     [](RenderOptions& o) {
       o.projection = Projection::kOrthographic;
       o.background = {0, 0, 0, 0};
     }},
    {"section_of_a_sphere", colored_sphere,
     [](RenderOptions& o) {
       o.section = {0.2, 0.1, 1.0, -0.2};
     }},
    {"occlusion_and_shadow_on_cubes", corner_with_pillar,
     [](RenderOptions& o) { o.occlusion = o.shadow = true; }},
    {"occlusion_and_shadow_on_small_voxels", plain_sphere,
     [](RenderOptions& o) {
       o.occlusion = o.shadow = true;
       o.section = {0, 0, 1, -0.3};
     }},
    {"wide_and_zoomed_from_below", few_voxels,
     [](RenderOptions& o) {
       o.width = 96;
       o.height = 48;
       o.elevation_deg = -35;
       o.zoom = 1.6;
       o.background = {30, 60, 90, 255};
     }},
    {"style_voxel", coarse_sphere, [](RenderOptions& o) { o = options_in(Style::kVoxel, 96, 96); }},
    {"style_voxel_of_small_voxels_cut", plain_sphere,
     [](RenderOptions& o) {
       o = options_in(Style::kVoxel, 64, 64);
       o.section = {0.2, 0.1, 1.0, -0.2};
     }},
    {"style_voxel_transparent", few_voxels,
     [](RenderOptions& o) {
       o = options_in(Style::kVoxel, 64, 64);
       o.background = {0, 0, 0, 0};
     }},
    {"style_clay", colored_sphere, [](RenderOptions& o) { o = options_in(Style::kClay, 64, 64); }},
    {"style_iso", corner_with_pillar,
     [](RenderOptions& o) { o = options_in(Style::kIso, 64, 64); }},
    {"style_blueprint", corner_with_pillar,
     [](RenderOptions& o) {
       o = options_in(Style::kBlueprint, 64, 64);
       o.azimuth_deg = 33.3;  // no line on a boundary of pixels
     }},
    {"style_blueprint_of_small_voxels", plain_sphere,
     [](RenderOptions& o) { o = options_in(Style::kBlueprint, 64, 64); }},
};

class Golden : public ::testing::TestWithParam<GoldenCase> {};

TEST_P(Golden, image_is_as_it_was) {
  const auto renderer = make_test_renderer();
  ASSERT_TRUE(renderer->set_grid(GetParam().grid()).ok());
  RenderOptions options = plain_options(Style::kSmooth, 64, 64);
  GetParam().adjust(options);
  const auto image = renderer->render(options, {});
  ASSERT_TRUE(image.ok()) << image.error().message();
  expect_golden(GetParam().name, *image);
}

INSTANTIATE_TEST_SUITE_P(Images, Golden, ::testing::ValuesIn(kCases),
                         [](const auto& one) { return std::string(one.param.name); });

}  // namespace
}  // namespace voxeld
