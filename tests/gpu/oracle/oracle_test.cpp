// All pipelines against the oracle of tests/reference, which shares nothing with them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <map>
#include <random>

#include "server/base/disk/file.h"
#include "server/gpu/context.h"
#include "server/gpu/shader_library.h"
#include "server/scene/load.h"
#include "server/voxel/gl/gl_pipeline.h"
#include "server/voxel/voxelize.h"
#include "tests/reference/color_oracle.h"
#include "tests/reference/line_oracle.h"
#include "tests/reference/touch_oracle.h"
#include "tests/unit/long_form.h"

namespace voxeld {
namespace {

using reference::OracleGrid;
using reference::Point;
using reference::Triangle;

constexpr std::array<std::pair<PipelineChoice, const char*>, 3> kPipelines = {
    {{PipelineChoice::kCompute, "compute"},
     {PipelineChoice::kRaster, "raster"},
     {PipelineChoice::kCpu, "cpu"}}};

constexpr std::array<std::pair<Rule, const char*>, 3> kRules = {
    {{Rule::kTouch, "touch"}, {Rule::kThin, "thin"}, {Rule::kCenter, "center"}}};

// One context for all tests of the process.
struct Gpu {
  std::unique_ptr<gpu::Context> context;
  std::unique_ptr<gpu::ShaderLibrary> shaders;
  std::unique_ptr<Voxelizer> voxelizer;

  static Gpu& instance() {
    static Gpu gpu = [] {
      const char* name = std::getenv("VOXELD_TEST_DEVICE");
      const auto device = gpu::parse_device(name != nullptr ? name : "llvmpipe");
      auto context = gpu::Context::create(*device);
      if (!context) {
        std::cerr << context.error().message() << "\n";
        std::abort();
      }
      Gpu made;
      made.context = std::move(context).value();
      std::cout << "renderer: " << made.context->info().renderer << std::endl;
      made.shaders = std::make_unique<gpu::ShaderLibrary>(*made.context);
      made.voxelizer =
          std::make_unique<Voxelizer>(std::make_unique<GlPipeline>(*made.context, *made.shaders));
      return made;
    }();
    return gpu;
  }
};

Grid voxelize(const Scene& scene, VoxelizeOptions options, PipelineChoice pipeline) {
  options.pipeline = pipeline;
  VoxelizeStats stats;
  auto grid = Gpu::instance().voxelizer->voxelize(
      scene, options, [](int64_t, int64_t) { return true; }, &stats);
  EXPECT_TRUE(grid.ok()) << grid.error().message();
  return std::move(grid).value();
}

reference::Occupancy dense(const Grid& grid) {
  reference::Occupancy cells(static_cast<size_t>(grid.spec.cell_count()));
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t) {
      cells[static_cast<size_t>(x + int64_t{grid.spec.dims.x} *
                                        (y + int64_t{grid.spec.dims.y} * z))] = 1;
    });
  }
  return cells;
}

OracleGrid oracle_grid(const GridSpec& spec) {
  return {{spec.dims.x, spec.dims.y, spec.dims.z},
          {spec.origin_world.x, spec.origin_world.y, spec.origin_world.z},
          {spec.voxel_size.x, spec.voxel_size.y, spec.voxel_size.z}};
}

std::vector<Triangle> triangles_of(const Scene& scene) {
  std::vector<Triangle> triangles;
  for (const MeshPart& part : scene.parts) {
    for (size_t i = 0; i + 2 < part.indices.size(); i += 3) {
      Triangle triangle;
      for (size_t k = 0; k < 3; ++k) {
        const glm::dvec3& p = part.positions[part.indices[i + k]];
        triangle[k] = {p.x, p.y, p.z};
      }
      triangles.push_back(triangle);
    }
  }
  return triangles;
}

void expect_same_cells(const reference::Occupancy& expected, const reference::Occupancy& got,
                       const std::string& what) {
  ASSERT_EQ(expected.size(), got.size());
  size_t missed = 0, extra = 0;
  for (size_t i = 0; i < expected.size(); ++i) {
    missed += expected[i] != 0 && got[i] == 0;
    extra += expected[i] == 0 && got[i] != 0;
  }
  EXPECT_EQ(missed, 0u) << what << " of " << reference::count(expected);
  EXPECT_EQ(extra, 0u) << what << " of " << reference::count(expected);
}

reference::Occupancy expected_cells(const Scene& scene, const GridSpec& spec, Rule rule) {
  const std::vector<Triangle> triangles = triangles_of(scene);
  if (rule == Rule::kThin) return reference::thin_cells(triangles, oracle_grid(spec));
  if (rule == Rule::kCenter) return reference::center_cells(triangles, oracle_grid(spec));
  return reference::touched_cells(triangles, oracle_grid(spec));
}

void expect_oracle(const Scene& scene, VoxelizeOptions options, const std::string& what) {
  for (const auto& [rule, rule_name] : kRules) {
    options.rule = rule;
    reference::Occupancy expected;
    for (const auto& [pipeline, name] : kPipelines) {
      const Grid grid = voxelize(scene, options, pipeline);
      if (expected.empty()) expected = expected_cells(scene, grid.spec, rule);
      expect_same_cells(expected, dense(grid), what + " " + rule_name + " " + name);
    }
  }
}

Scene scene_of(const std::vector<Triangle>& triangles) {
  Scene scene;
  scene.parts.emplace_back();
  for (const Triangle& triangle : triangles) {
    for (const Point& p : triangle) {
      scene.parts[0].indices.push_back(static_cast<uint32_t>(scene.parts[0].positions.size()));
      scene.parts[0].positions.emplace_back(p[0], p[1], p[2]);
    }
  }
  return scene;
}

// Walls over lines through centres of columns, seen edge-on along an axis, and sides through
// centres: corners at (odd, odd) / 512 from a centre. Coordinates are exact.
void add_ties(std::vector<Triangle>& triangles, uint64_t seed, int count, int extent, int size) {
  std::mt19937_64 random(seed);
  const auto integer = [&](int low, int high) {
    return low + static_cast<int>(random() % static_cast<uint64_t>(high - low + 1));
  };
  for (int t = 0; t < count; ++t) {
    const auto axis = static_cast<size_t>(integer(0, 2)), x = (axis + 1) % 3, y = (axis + 2) % 3;
    const double at_x = integer(0, extent - 1) + 0.5, at_y = integer(0, extent - 1) + 0.5;
    const double at_z = integer(0, extent - 1);
    const int ratio = 2 * integer(-2, 1) + 1;
    Triangle triangle;
    for (Point& p : triangle) {
      const int odd = 2 * integer(-128 * size, 128 * size) + 1;
      p[x] = at_x + odd / 512.0;
      p[y] = at_y + (t % 3 == 0 ? 2 * integer(-128, 127) + 1 : odd * ratio) / 512.0;
      p[axis] = at_z + integer(-256 * size, 256 * size) / 512.0;
    }
    if (t % 3 == 1) {
      // A side through the centre, and a corner anywhere.
      triangle[2][x] = at_x + integer(-256 * size, 256 * size) / 512.0;
    }
    for (Point& p : triangle) {
      for (double& v : p) v = std::clamp(v, 0.0, static_cast<double>(extent));
    }
    triangles.push_back(triangle);
  }
}

// A soup of every kind of trouble: slivers, degenerate triangles, coordinates on grid planes and
// on cell centres, very small and rather large ones. `extent` is the box's side.
std::vector<Triangle> soup(uint64_t seed, int count, double extent, double size_max) {
  std::mt19937_64 random(seed);
  const auto uniform = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  std::vector<Triangle> triangles = {
      Triangle{Point{0, 0, 0}, Point{0, 0, 0}, Point{0, 0, 0}},
      Triangle{Point{extent, extent, extent}, Point{extent, extent, extent},
               Point{extent, extent, extent}}};
  for (int t = 0; t < count; ++t) {
    const int kind = t % 10;
    const double size = std::pow(2.0, uniform(-3, std::log2(size_max)));
    const Point c = {uniform(0, extent), uniform(0, extent), uniform(0, extent)};
    Triangle triangle;
    for (Point& p : triangle) {
      for (int i = 0; i < 3; ++i) p[i] = c[i] + uniform(-size, size);
      if (kind == 1 || kind == 2)
        std::ranges::transform(p, p.begin(), [](double v) { return std::round(v); });
      if (kind == 3) p[0] = std::round(c[0]);
      if (kind == 4) p[1] = std::floor(c[1]) + 0.5;
      if (kind == 5) p[0] = std::round(c[0]), p[1] = std::round(c[1]);
    }
    if (kind == 6) triangle[2] = triangle[0];
    if (kind == 7) triangle[1] = triangle[2] = triangle[0];
    if (kind == 8) {
      const double u = uniform(0, 1);
      for (int i = 0; i < 3; ++i) {
        triangle[2][i] = triangle[0][i] + (triangle[1][i] - triangle[0][i]) * u;
      }
      triangle[2][2] += uniform(-0.01, 0.01);
    }
    for (Point& p : triangle) {
      for (double& v : p) v = std::clamp(v, 0.0, extent);
    }
    triangles.push_back(triangle);
  }
  return triangles;
}

TEST(Oracle, soups_of_awkward_triangles_give_exactly_the_cells_of_each_rule) {
  for (const uint64_t seed : by_form<uint64_t>({1}, {1, 2, 3})) {
    VoxelizeOptions options;
    options.placement.size = 64;
    expect_oracle(scene_of(soup(seed, 4000, 64, 8)), options, "seed " + std::to_string(seed));
  }
}

TEST(Oracle, walls_and_sides_over_centres_give_exactly_the_cells_of_each_rule) {
  for (const int size : {1, 4, 30}) {
    VoxelizeOptions options;
    options.placement.size = 64;
    std::vector<Triangle> triangles = soup(7, 8, 64, 2);  // corners of the box
    add_ties(triangles, static_cast<uint64_t>(size), 1500 / size, 64, size);
    expect_oracle(scene_of(triangles), options, "size " + std::to_string(size));
  }
}

TEST(Oracle, grids_that_cross_tiles_give_exactly_the_cells_of_each_rule) {
  VoxelizeOptions options;
  options.placement.size = 300;
  expect_oracle(scene_of(soup(4, 3000, 300, 40)), options, "300");
}

TEST(Oracle, giant_triangles_give_exactly_the_cells_of_each_rule) {
  VoxelizeOptions options;
  options.placement.size = 256;
  expect_oracle(scene_of(soup(5, 20, 256, 256)), options, "giant");
}

TEST(Oracle, grids_that_are_not_cubes_give_exactly_the_cells_of_each_rule) {
  for (const std::array<int, 3> dims :
       {std::array{1, 1, 1}, {1, 40, 7}, {33, 5, 64}, {257, 3, 9}}) {
    VoxelizeOptions options;
    options.placement.dims = dims;
    options.placement.bounds = {0, 0, 0, 32, 32, 32};
    expect_oracle(scene_of(soup(6, 500, 32, 6)), options, std::to_string(dims[0]));
  }
}

TEST(Oracle, a_real_scan_gives_exactly_the_cells_of_each_rule) {
  const char* data = std::getenv("VOXELD_DATA_DIR");
  if (data == nullptr) GTEST_SKIP() << "VOXELD_DATA_DIR is not set: no real meshes";
  const std::string path = std::string(data) + "/scans/bunny/bun_zipper.ply";
  const auto file = MappedFile::open(path);
  ASSERT_TRUE(file.ok()) << file.error().message();
  const auto scene = load_scene(path, file->bytes());
  ASSERT_TRUE(scene.ok()) << scene.error().message();
  VoxelizeOptions options;
  options.placement.size = 256;
  expect_oracle(*scene, options, "bunny");
}

// A wavy sheet, tessellated, with vertex colours or a smooth texture over it.
// `bent` maps the texture by the complex square, which is conformal: from 0 to 1.4 times as dense,
// so that triangles take different mip levels, and equally dense in both directions, as one level
// can average it.
Scene sheet(int n, bool textured, bool bent = false) {
  Scene scene;
  scene.materials.emplace_back();
  MeshPart part;
  part.material = 0;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) {
      const double u = double(i) / n, v = double(j) / n;
      part.positions.emplace_back(u, v, 0.3 * std::sin(5 * u) * std::cos(4 * v));
      if (textured) {
        part.uvs.emplace_back(bent ? glm::vec2((u * u - v * v + 1) / 2, u * v) : glm::vec2(u, v));
      } else {
        part.colors.emplace_back(u, 1 - v, 0.5 + 0.5 * std::sin(6 * u), 1);
      }
    }
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const uint32_t a = static_cast<uint32_t>(j * (n + 1) + i), b = a + 1,
                     c = a + static_cast<uint32_t>(n) + 1, d = c + 1;
      part.indices.insert(part.indices.end(), {a, b, d, a, d, c});
    }
  }
  if (textured) {
    Image image;
    image.width = image.height = 256;
    for (int y = 0; y < 256; ++y) {
      for (int x = 0; x < 256; ++x) {
        image.rgba.push_back(static_cast<uint8_t>(x));
        image.rgba.push_back(static_cast<uint8_t>(128 + 100 * std::sin(y * 0.05)));
        image.rgba.push_back(static_cast<uint8_t>(255 - y));
        image.rgba.push_back(255);
      }
    }
    scene.images.push_back(std::move(image));
    scene.materials[0].image = 0;
    scene.materials[0].wrap_u = scene.materials[0].wrap_v = Wrap::kClamp;
  }
  scene.parts.push_back(std::move(part));
  return scene;
}

std::array<double, 4> bilinear(const Image& image, double u, double v) {
  const auto texel = [&](int x, int y, int c) {
    x = std::clamp(x, 0, image.width - 1);
    y = std::clamp(y, 0, image.height - 1);
    const double value = image.rgba[4 * (static_cast<size_t>(y) * static_cast<size_t>(image.width) +
                                         static_cast<size_t>(x)) +
                                    static_cast<size_t>(c)] /
                         255.0;
    return c == 3 ? value : reference::linear_from_srgb(value);
  };
  const double x = u * image.width - 0.5, y = v * image.height - 0.5;
  const int ix = static_cast<int>(std::floor(x)), iy = static_cast<int>(std::floor(y));
  const double fx = x - ix, fy = y - iy;
  std::array<double, 4> color{};
  for (int c = 0; c < 4; ++c) {
    color[static_cast<size_t>(c)] =
        (texel(ix, iy, c) * (1 - fx) + texel(ix + 1, iy, c) * fx) * (1 - fy) +
        (texel(ix, iy + 1, c) * (1 - fx) + texel(ix + 1, iy + 1, c) * fx) * fy;
  }
  return color;
}

// Mean and largest difference (of 255) between the grid's colours and the oracle's, over voxels
// with a fair piece of surface in them.
void expect_colors(const Scene& scene, int size, double mean_max, double largest_max) {
  VoxelizeOptions options;
  options.placement.size = size;
  const MeshPart& part = scene.parts[0];
  const auto color_at = [&](size_t t, const std::array<double, 3>& bary) {
    std::array<double, 4> color{};
    glm::dvec2 uv{0};
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t i = part.indices[3 * t + k];
      if (!part.uvs.empty()) uv += bary[k] * glm::dvec2(part.uvs[i]);
      for (int c = 0; c < 4 && !part.colors.empty(); ++c) {
        color[static_cast<size_t>(c)] += bary[k] * static_cast<double>(part.colors[i][c]);
      }
    }
    return part.uvs.empty() ? color : bilinear(scene.images[0], uv.x, uv.y);
  };
  std::map<size_t, reference::CellColor> expected;
  for (const auto& [pipeline, name] : kPipelines) {
    const Grid grid = voxelize(scene, options, pipeline);
    ASSERT_TRUE(grid.channels.color);
    if (expected.empty()) {
      expected = reference::average_colors(triangles_of(scene), oracle_grid(grid.spec), color_at);
    }
    double sum = 0, largest = 0;
    size_t compared = 0;
    for (const SparseTile& tile : grid.tiles) {
      for_each_voxel(tile, [&](int x, int y, int z, size_t index) {
        const auto it = expected.find(static_cast<size_t>(
            x + int64_t{grid.spec.dims.x} * (y + int64_t{grid.spec.dims.y} * z)));
        if (it == expected.end() || it->second.area < 0.2) return;
        for (size_t c = 0; c < 3; ++c) {
          const double want = 255 * reference::srgb_from_linear(it->second.linear_rgba[c]);
          const double difference = std::abs(want - tile.color[4 * index + c]);
          sum += difference;
          largest = std::max(largest, difference);
        }
        ++compared;
      });
    }
    ASSERT_GT(compared, 100u);
    EXPECT_LE(sum / static_cast<double>(3 * compared), mean_max);
    EXPECT_LE(largest, largest_max);
  }
}

TEST(Oracle, vertex_colours_are_area_averages_in_linear_light) {
  // The 4x4 lattice places the centroid of a partial cell to about an eighth of a voxel; dark sRGB
  // is steep, hence the largest difference.
  expect_colors(sheet(40, false), 64, 1.0, 14.0);
}

TEST(Oracle, texture_colours_are_area_averages_in_linear_light) {
  expect_colors(sheet(40, true), 64, 1.5, 14.0);
}

TEST(Oracle, large_textured_triangles_are_averaged_too) {
  expect_colors(sheet(3, true), 48, 1.5, 14.0);
}

TEST(Oracle, textures_of_uneven_density_are_averaged_too) {
  expect_colors(sheet(40, true, true), 64, 1.5, 14.0);
}

}  // namespace
}  // namespace voxeld
