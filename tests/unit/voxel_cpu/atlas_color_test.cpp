// color=average of textures that are atlases: charts of strongly different colours, with black
// between them, against dense sampling of the surface.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "server/base/disk/file.h"
#include "server/scene/load.h"
#include "server/voxel/cpu/cpu_pipeline.h"
#include "server/voxel/voxelize.h"
#include "tests/reference/color_oracle.h"
#include "tests/reference/texture_oracle.h"
#include "tests/unit/long_form.h"

namespace voxeld {
namespace {

// Bounds of the mean and the 95th percentile, of 255, at every size.
constexpr double kMeanMax = 2.0, kP95Max = 10.0;

// At 16 most charts and triangles are smaller than a voxel. At 96 they are larger, and so are the
// texels of one atlas. The oracle's time grows with the square of the size.
std::vector<int> grid_sizes() {
#ifdef VOXELD_SANITIZED
  return {16, 48};  // the oracle of the others takes a quarter of an hour
#else
  return by_form<int>({16, 48, 96}, {16, 32, 48, 64, 128, 256});
#endif
}

// Differences of bytes of red, green and blue, or of alpha.
struct ColorError {
  double mean = 0, p95 = 0;
  size_t voxels = 0;
};

// The surface as the oracle sees it.
struct Surface {
  std::vector<reference::Triangle> triangles;
  struct Source {
    const MeshPart* part;
    size_t first_index;
  };
  std::vector<Source> sources;
};

Surface surface_of(const Scene& scene) {
  Surface surface;
  for (const MeshPart& part : scene.parts) {
    for (size_t i = 0; i + 2 < part.indices.size(); i += 3) {
      reference::Triangle triangle;
      for (size_t k = 0; k < 3; ++k) {
        const glm::dvec3& p = part.positions[part.indices[i + k]];
        triangle[k] = {p.x, p.y, p.z};
      }
      surface.triangles.push_back(triangle);
      surface.sources.push_back({&part, i});
    }
  }
  return surface;
}

reference::Edge edge_of(Wrap wrap) {
  if (wrap == Wrap::kClamp) return reference::Edge::kClamp;
  return wrap == Wrap::kRepeat ? reference::Edge::kRepeat : reference::Edge::kMirror;
}

// Base colour, vertex colour and texture at a point of triangle t, multiplied by alpha. Vertex and
// base colours are opaque.
std::array<double, 4> surface_color(const Scene& scene, const Surface& surface, size_t t,
                                    const std::array<double, 3>& bary) {
  const auto& [part, first] = surface.sources[t];
  std::array<double, 4> color{1, 1, 1, 1}, vertex{};
  std::array<reference::TexturePoint, 3> uvs{};
  for (size_t k = 0; k < 3; ++k) {
    const uint32_t index = part->indices[first + k];
    if (!part->uvs.empty()) uvs[k] = {double(part->uvs[index].x), double(part->uvs[index].y)};
    if (part->colors.empty()) continue;
    for (int c = 0; c < 4; ++c) {
      vertex[static_cast<size_t>(c)] += bary[k] * double(part->colors[index][c]);
    }
  }
  if (!part->colors.empty()) color = vertex;
  if (part->material < 0) return color;
  const Material& material = scene.materials[static_cast<size_t>(part->material)];
  for (int c = 0; c < 4; ++c) color[static_cast<size_t>(c)] *= double(material.base_color[c]);
  if (part->uvs.empty() || material.image < 0) return color;
  const Image& image = scene.images[static_cast<size_t>(material.image)];
  const reference::Texture texture{image.width, image.height, image.rgba, edge_of(material.wrap_u),
                                   edge_of(material.wrap_v)};
  const auto texel = reference::texture_color(texture, uvs, bary);
  for (size_t c = 0; c < 4; ++c) color[c] *= texel[c];
  return color;
}

// Area of a voxel's surface, in faces. Snapping moves surface into and out of voxels with less.
constexpr double kAreaMin = 1.0 / 16;
// Samples of the oracle along a voxel's side.
constexpr double kSamplesPerVoxel = 12;

enum class Component { kColor, kAlpha };

ColorError color_error(const Scene& scene, int size, Component component) {
  VoxelizeOptions options;
  options.placement.size = size;
  options.color = ColorMode::kAverage;
  Voxelizer voxelizer;
  VoxelizeStats stats;
  auto grid = voxelizer.voxelize(scene, options, {}, &stats);
  EXPECT_TRUE(grid.ok()) << grid.error().message();
  const GridSpec& spec = grid->spec;
  const Surface surface = surface_of(scene);
  const auto expected = reference::average_colors(
      surface.triangles,
      {{spec.dims.x, spec.dims.y, spec.dims.z},
       {spec.origin_world.x, spec.origin_world.y, spec.origin_world.z},
       {spec.voxel_size.x, spec.voxel_size.y, spec.voxel_size.z}},
      [&](size_t t, const std::array<double, 3>& bary) {
        return surface_color(scene, surface, t, bary);
      },
      kSamplesPerVoxel);
  std::vector<double> differences;
  // Colours that are hardly seen are not compared.
  constexpr double kAlphaMin = 1.0 / 16;
  for (const SparseTile& tile : grid->tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      const auto it = expected.find(
          static_cast<size_t>(x + int64_t{spec.dims.x} * (y + int64_t{spec.dims.y} * z)));
      if (it == expected.end() || it->second.area < kAreaMin) return;
      const auto& linear = it->second.linear_rgba;
      if (component == Component::kAlpha) {
        differences.push_back(std::abs(255 * linear[3] - tile.color[4 * voxel + 3]));
        return;
      }
      for (size_t c = 0; c < 3 && linear[3] >= kAlphaMin; ++c) {
        const double want = 255 * reference::srgb_from_linear(linear[c] / linear[3]);
        differences.push_back(std::abs(want - tile.color[4 * voxel + c]));
      }
    });
  }
  ColorError error;
  error.voxels = differences.size() / (component == Component::kColor ? 3 : 1);
  if (differences.empty()) return error;
  std::ranges::sort(differences);
  for (const double difference : differences) error.mean += difference;
  error.mean /= static_cast<double>(differences.size());
  error.p95 = differences[differences.size() * 95 / 100];
  double attribute_ms = 0;
  for (const auto& [name, ms] : stats.passes) attribute_ms += name == "attributes" ? ms : 0;
  std::cout << "size " << size << ": mean " << error.mean << ", p95 " << error.p95 << ", voxels "
            << error.voxels << ", attributes " << attribute_ms << " ms" << std::endl;
  return error;
}

struct AtlasShape {
  int charts_u = 24, charts_v = 12;  // over the ball
  int quads = 1;                     // along a chart's side
  int texels = 20, gutter = 4;       // of a chart; black texels between two
  bool patterned = false;            // stripes over the charts' colours
  int hole = 0;                      // a chessboard of this side: black and transparent fields
};

// A ball whose surface is cut into charts, in random order in the atlas.
Scene atlas_ball(const AtlasShape& shape) {
  const int count = shape.charts_u * shape.charts_v, pitch = shape.texels + shape.gutter;
  Scene scene;
  Image image{"atlas", shape.charts_u * pitch, shape.charts_v * pitch, {}};
  image.rgba.assign(4 * static_cast<size_t>(image.width) * static_cast<size_t>(image.height), 0);
  for (size_t i = 3; i < image.rgba.size(); i += 4) image.rgba[i] = 255;
  std::mt19937 random(5);
  std::vector<int> places(static_cast<size_t>(count));
  for (int i = 0; i < count; ++i) places[static_cast<size_t>(i)] = i;
  for (size_t i = places.size(); i > 1; --i) std::swap(places[i - 1], places[random() % i]);
  MeshPart part;
  part.material = 0;
  const auto on_ball = [&](double u, double v) {
    const double a = 2 * std::numbers::pi * u, b = std::numbers::pi * (v - 0.5);
    return glm::dvec3(std::cos(b) * std::cos(a), std::cos(b) * std::sin(a), std::sin(b));
  };
  for (int chart = 0; chart < count; ++chart) {
    const int place = places[static_cast<size_t>(chart)];
    const int left = place % shape.charts_u * pitch + shape.gutter / 2;
    const int top = place / shape.charts_u * pitch + shape.gutter / 2;
    std::array<uint32_t, 3> color{};
    for (uint32_t& c : color) c = static_cast<uint32_t>(random() % 256);
    for (int y = 0; y < shape.texels; ++y) {
      for (int x = 0; x < shape.texels; ++x) {
        uint8_t* texel = &image.rgba[4 * (static_cast<size_t>(top + y) * size_t(image.width) +
                                          static_cast<size_t>(left + x))];
        const uint32_t shade =
            shape.patterned ? 4 - static_cast<uint32_t>(x * 3 / shape.texels) : 4;
        const bool is_hole = shape.hole > 0 && (x / shape.hole + y / shape.hole) % 2 == 0;
        if (is_hole) texel[3] = 0;
        for (size_t c = 0; c < 3 && !is_hole; ++c) {
          texel[c] = static_cast<uint8_t>(color[c] * shade / 4);
        }
      }
    }
    // Half a texel inside, as atlases are made: bilinear sampling stays within the chart.
    const auto first = static_cast<uint32_t>(part.positions.size());
    const int n = shape.quads;
    for (int j = 0; j <= n; ++j) {
      for (int i = 0; i <= n; ++i) {
        const double s = double(i) / n, t = double(j) / n;
        part.positions.push_back(on_ball((chart % shape.charts_u + s) / shape.charts_u,
                                         (chart / shape.charts_u + t) / shape.charts_v));
        part.uvs.emplace_back((left + 0.5 + s * (shape.texels - 1)) / image.width,
                              (top + 0.5 + t * (shape.texels - 1)) / image.height);
      }
    }
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) {
        const uint32_t a = first + static_cast<uint32_t>(j * (n + 1) + i);
        const uint32_t b = a + 1, d = a + static_cast<uint32_t>(n) + 1, c = d + 1;
        part.indices.insert(part.indices.end(), {a, b, c, a, c, d});
      }
    }
  }
  scene.materials.emplace_back();
  scene.materials[0].image = 0;
  scene.images.push_back(std::move(image));
  scene.parts.push_back(std::move(part));
  return scene;
}

void expect_close(const Scene& scene, const std::string& name) {
  for (const int size : grid_sizes()) {
    const ColorError error = color_error(scene, size, Component::kColor);
    ASSERT_GT(error.voxels, 100u);
    EXPECT_LE(error.mean, kMeanMax) << name << ", size " << size;
    EXPECT_LE(error.p95, kP95Max) << name << ", size " << size;
  }
}

TEST(AtlasColor, charts_of_a_few_large_triangles_keep_their_colours) {
  expect_close(atlas_ball({}), "2 triangles to a chart");
}

TEST(AtlasColor, charts_of_many_small_triangles_keep_their_colours) {
  expect_close(atlas_ball({.quads = 8}), "128 triangles to a chart");
}

TEST(AtlasColor, charts_of_many_texels_keep_their_colours) {
  const AtlasShape shape{.quads = 2, .texels = 120, .gutter = 8, .patterned = true};
  expect_close(atlas_ball(shape), "stripes");
}

TEST(AtlasColor, charts_of_a_texel_or_two_to_a_triangle_keep_their_colours) {
  const AtlasShape shape{.charts_u = 12, .charts_v = 6, .quads = 4, .texels = 6, .patterned = true};
  expect_close(atlas_ball(shape), "few texels");
}

TEST(AtlasColor, transparent_texels_have_no_share_in_colours_and_all_of_their_share_in_alpha) {
  for (const Scene& scene : {atlas_ball({.hole = 1}), atlas_ball({.quads = 8, .hole = 3})}) {
    expect_close(scene, "holes");
    // A voxel is as large as 8 texels, or 3.
    for (const auto& [size, mean_max] : {std::pair{16, 8.0}, {48, 16.0}}) {
      EXPECT_LE(color_error(scene, size, Component::kAlpha).mean, mean_max) << "size " << size;
    }
  }
}

// A square of quads^2 quads with a red chart in a green image.
Scene red_square(int quads) {
  constexpr int kSide = 512, kFirst = 200, kTexels = 64;
  Scene scene;
  Image image{"chart", kSide, kSide, {}};
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const bool is_inside =
          x >= kFirst && x < kFirst + kTexels && y >= kFirst && y < kFirst + kTexels;
      const std::array<uint8_t, 4> red{255, 0, 0, 255}, green{0, 255, 0, 255};
      const auto& color = is_inside ? red : green;
      image.rgba.insert(image.rgba.end(), color.begin(), color.end());
    }
  }
  MeshPart part;
  part.material = 0;
  for (int j = 0; j <= quads; ++j) {
    for (int i = 0; i <= quads; ++i) {
      // Texels between whose centres the surface lies are red.
      const auto uv = [&](int k) { return (kFirst + 1 + (kTexels - 2.0) * k / quads) / kSide; };
      part.positions.emplace_back(double(i) / quads, double(j) / quads, 0.3 * i / quads);
      part.uvs.emplace_back(uv(i), uv(j));
    }
  }
  for (int j = 0; j < quads; ++j) {
    for (int i = 0; i < quads; ++i) {
      const auto a = static_cast<uint32_t>(j * (quads + 1) + i);
      const uint32_t b = a + 1, d = a + static_cast<uint32_t>(quads) + 1, c = d + 1;
      part.indices.insert(part.indices.end(), {a, b, c, a, c, d});
    }
  }
  scene.materials.emplace_back();
  scene.materials[0].image = 0;
  scene.images.push_back(std::move(image));
  scene.parts.push_back(std::move(part));
  return scene;
}

TEST(AtlasColor, nothing_beside_a_chart_shows_in_its_colour) {
  for (const int quads : {1, 3, 20}) {
    const Scene scene = red_square(quads);
    for (const ColorMode mode : {ColorMode::kAverage, ColorMode::kDominant, ColorMode::kNearest}) {
      for (const int size : {1, 2, 3, 7, 16, 40, 100}) {
        VoxelizeOptions options;
        options.placement.size = size;
        options.color = mode;
        Voxelizer voxelizer;
        const auto grid = voxelizer.voxelize(scene, options, {}, nullptr);
        ASSERT_TRUE(grid.ok()) << grid.error().message();
        for (const SparseTile& tile : grid->tiles) {
          ASSERT_FALSE(tile.color.empty());
          for (size_t i = 0; i < tile.color.size(); i += 4) {
            ASSERT_EQ(tile.color[i], 255) << quads << " quads, size " << size;
            ASSERT_EQ(tile.color[i + 1], 0) << quads << " quads, size " << size;
          }
        }
      }
    }
  }
}

// A square of 1 x 1 with coordinates from `from` to `to` on both axes. The left half of the texture
// is red, its right half transparent.
Scene half_square(float from, float to) {
  constexpr int kSide = 64;
  Scene scene;
  Image image{"half", kSide, kSide, {}};
  for (int i = 0; i < kSide * kSide; ++i) {
    const uint8_t seen = i % kSide < kSide / 2 ? 255 : 0;
    image.rgba.insert(image.rgba.end(), {seen, 0, 0, seen});
  }
  MeshPart part;
  part.material = 0;
  part.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  part.uvs = {{from, from}, {to, from}, {to, to}, {from, to}};
  part.indices = {0, 1, 2, 0, 2, 3};
  scene.materials.emplace_back();
  scene.materials[0].image = 0;
  scene.images.push_back(std::move(image));
  scene.parts.push_back(std::move(part));
  return scene;
}

// The most alpha in a column of cells.
int alpha_of_column(const Scene& scene, int size, ColorMode mode, int column) {
  VoxelizeOptions options;
  options.placement.size = size;
  options.color = mode;
  Voxelizer voxelizer;
  const auto grid = voxelizer.voxelize(scene, options, {}, nullptr);
  EXPECT_TRUE(grid.ok()) << grid.error().message();
  int most = 0;
  for (const SparseTile& tile : grid->tiles) {
    for_each_voxel(tile, [&](int x, int, int, size_t voxel) {
      if (x == column) most = std::max(most, int{tile.color[4 * voxel + 3]});
    });
  }
  return most;
}

TEST(AtlasColor, a_square_with_all_of_a_texture_shows_nothing_of_the_opposite_side) {
  for (const float from : {0.0f, 3.0f, -2.0f, -0x1p-24f}) {
    const Scene scene = half_square(from, from + 1.0f);
    for (const ColorMode mode : {ColorMode::kAverage, ColorMode::kNearest}) {
      for (const int size : {8, 48, 64, 80, 128, 200}) {
        EXPECT_EQ(alpha_of_column(scene, size, mode, size - 1), 0) << from << ", size " << size;
        EXPECT_GT(alpha_of_column(scene, size, mode, 0), 250) << from << ", size " << size;
      }
    }
  }
}

TEST(AtlasColor, a_square_with_two_periods_of_a_texture_sees_it_repeat) {
  const Scene scene = half_square(0.0f, 2.0f);
  // A texel is as large as two voxels. The last voxel of the first period is a quarter of a texel
  // off its side.
  EXPECT_NEAR(alpha_of_column(scene, 256, ColorMode::kNearest, 127), 64, 2);
}

// A grid of one octant: threads share its triangles.
TEST(AtlasColor, colours_do_not_depend_on_the_number_of_threads) {
  const Scene scene = atlas_ball({.quads = 5});
  ASSERT_GT(scene.triangle_count(), 10'000u);
  for (const bool with_normals : {false, true}) {
    VoxelizeOptions options;
    options.placement.size = 24;
    options.channels = ChannelSet{.color = true, .normal = with_normals};
    const auto one = Voxelizer(nullptr, 1).voxelize(scene, options, {}, nullptr);
    const auto five = Voxelizer(nullptr, 5).voxelize(scene, options, {}, nullptr);
    ASSERT_TRUE(one.ok() && five.ok());
    EXPECT_EQ(one->tiles, five->tiles);
  }
}

// Sizes at which most triangles are smaller than a cell, about as large, and larger than a vector.
TEST(AtlasColor, attributes_are_the_same_by_every_instruction_set) {
  const Scene scene = atlas_ball({.quads = 5});
  for (const int size : {12, 90, 400}) {
    for (const bool has_color : {false, true}) {
      VoxelizeOptions options;
      options.placement.size = size;
      options.channels = ChannelSet{.color = has_color, .normal = true};
      options.pipeline = PipelineChoice::kCompute;  // the device, which is a CpuPipeline here
      std::vector<SparseTile> expected;
      for (const CpuIsa isa : supported_cpu_isas()) {
        auto pipeline = std::make_unique<CpuPipeline>(1, isa);
        auto grid = Voxelizer(std::move(pipeline)).voxelize(scene, options, {}, nullptr);
        ASSERT_TRUE(grid.ok());
        if (isa == CpuIsa::kPortable) expected = grid->tiles;
        ASSERT_EQ(grid->tiles, expected) << size << ' ' << cpu_isa_name(isa);
      }
      ASSERT_FALSE(expected.empty());
    }
  }
}

Result<Scene> real_scene(const std::string& folder, const std::string& mesh) {
  std::vector<MappedFile> files;
  std::vector<BundledFile> named;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    VOXELD_ASSIGN(MappedFile file, MappedFile::open(entry.path().string()));
    named.push_back({entry.path().filename().string(), file.bytes()});
    files.push_back(std::move(file));
  }
  const auto bundle = files_bundle(named);
  return load_scene("bundle!" + mesh, *bundle);
}

// All their textures are PNG or JPEG.
TEST(AtlasColor, real_textured_meshes_have_the_colours_of_their_surface) {
  const char* data = std::getenv("VOXELD_DATA_DIR");
  if (data == nullptr) GTEST_SKIP() << "VOXELD_DATA_DIR is not set: no real meshes";
  using Mesh = std::pair<const char*, const char*>;
  const Mesh fox{"/gltf/Fox", "Fox.gltf"}, spider{"/obj/spider", "spider.obj"};
  for (const auto& [folder, mesh] :
       by_form<Mesh>({fox, spider}, {fox,
                                     spider,
                                     {"/gltf", "Duck.glb"},
                                     {"/gltf", "CesiumMan.glb"},
                                     {"/md5/bob", "Bob.md5mesh"},
                                     {"/obj/spot", "spot_triangulated.obj"}})) {
    const auto scene = real_scene(std::string(data) + folder, mesh);
    ASSERT_TRUE(scene.ok()) << scene.error().message();
    ASSERT_FALSE(scene->images.empty()) << mesh;
    std::cout << mesh << "\n";
    expect_close(*scene, mesh);
  }
}

}  // namespace
}  // namespace voxeld
