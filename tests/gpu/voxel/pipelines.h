// Scenes and helpers for the tests of the pipelines.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "server/voxel/gl/gl_pipeline.h"
#include "server/voxel/voxelize.h"
#include "tests/gpu/context/test_device.h"

namespace voxeld::pipelines {

inline constexpr std::array<PipelineChoice, 3> kPipelines = {
    PipelineChoice::kCompute, PipelineChoice::kRaster, PipelineChoice::kCpu};

// Programs that all tests of a binary share: to compile them again takes longer than most tests.
// Tunings choose among them by defines.
inline gpu::ShaderLibrary& shared_shaders() {
  static gpu::ShaderLibrary shaders(gpu::test_context());
  return shaders;
}

inline Voxelizer& voxelizer() {
  static Voxelizer one(std::make_unique<GlPipeline>(gpu::test_context(), shared_shaders()));
  return one;
}

// Pipeline compute as hardware runs it, whatever the device is.
inline Voxelizer& batched_voxelizer() {
  static Voxelizer one(std::make_unique<GlPipeline>(gpu::test_context(), shared_shaders(),
                                                    GlTuning{.batches = true}));
  return one;
}

inline Grid voxelize_on(Voxelizer& one, const Scene& scene, VoxelizeOptions options,
                        PipelineChoice pipeline, VoxelizeStats* stats = nullptr) {
  options.pipeline = pipeline;
  auto grid = one.voxelize(scene, options, {}, stats);
  if (!grid) {
    ADD_FAILURE() << grid.error().message();
    return {};
  }
  return std::move(grid).value();
}

inline Grid voxelize(const Scene& scene, const VoxelizeOptions& options, PipelineChoice pipeline,
                     VoxelizeStats* stats = nullptr) {
  return voxelize_on(voxelizer(), scene, options, pipeline, stats);
}

// Voxelizes by all pipelines, expects the same bytes, and gives one of the grids.
inline Grid voxelize_all(const Scene& scene, const VoxelizeOptions& options,
                         const std::string& what = "") {
  Grid compute = voxelize(scene, options, PipelineChoice::kCompute);
  for (const PipelineChoice other : {PipelineChoice::kRaster, PipelineChoice::kCpu}) {
    const std::string name = other == PipelineChoice::kCpu ? "cpu: " : "raster: ";
    const Grid grid = voxelize(scene, options, other);
    EXPECT_EQ(compute.channels, grid.channels) << name << what;
    EXPECT_TRUE(compute.tiles == grid.tiles) << "differs from compute: " << name << what;
  }
  const Grid batched = voxelize_on(batched_voxelizer(), scene, options, PipelineChoice::kCompute);
  EXPECT_TRUE(compute.tiles == batched.tiles) << "differs from compute: batches: " << what;
  return compute;
}

// A grid whose cells are the unit cubes of the world's box from 0 to dims.
inline VoxelizeOptions unit_cells(std::array<int, 3> dims) {
  VoxelizeOptions options;
  options.placement.voxel_size = {1.0, 1.0, 1.0};
  options.placement.bounds = {0, 0, 0, double(dims[0]), double(dims[1]), double(dims[2])};
  return options;
}

// The contents of a voxel, by its cell.
struct Voxel {
  std::array<int, 4> color{};
  std::array<int, 3> normal{};
  bool operator==(const Voxel&) const = default;
};
using Cells = std::map<std::array<int, 3>, Voxel>;

inline Cells cells_of(const Grid& grid) {
  Cells cells;
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t index) {
      Voxel& voxel = cells[{x, y, z}];
      if (grid.channels.color) {
        for (size_t c = 0; c < 4; ++c) voxel.color[c] = tile.color[4 * index + c];
      }
      if (grid.channels.normal) {
        for (size_t c = 0; c < 3; ++c) voxel.normal[c] = tile.normal[3 * index + c];
      }
    });
  }
  return cells;
}

inline size_t voxel_count(const Grid& grid) {
  size_t count = 0;
  for (const SparseTile& tile : grid.tiles) count += tile.voxel_count();
  return count;
}

inline void add_triangle(MeshPart& part, const glm::dvec3& a, const glm::dvec3& b,
                         const glm::dvec3& c) {
  for (const glm::dvec3& p : {a, b, c}) {
    part.indices.push_back(static_cast<uint32_t>(part.positions.size()));
    part.positions.push_back(p);
  }
}

// Corners in order around the quad.
inline void add_quad(MeshPart& part, const std::array<glm::dvec3, 4>& p) {
  const auto first = static_cast<uint32_t>(part.positions.size());
  part.positions.insert(part.positions.end(), p.begin(), p.end());
  for (const uint32_t i : {0u, 1u, 2u, 0u, 2u, 3u}) part.indices.push_back(first + i);
}

// Outward faces.
inline void add_box(MeshPart& part, const glm::dvec3& a, const glm::dvec3& b) {
  add_quad(part, {glm::dvec3(a.x, a.y, a.z), {a.x, b.y, a.z}, {b.x, b.y, a.z}, {b.x, a.y, a.z}});
  add_quad(part, {glm::dvec3(a.x, a.y, b.z), {b.x, a.y, b.z}, {b.x, b.y, b.z}, {a.x, b.y, b.z}});
  add_quad(part, {glm::dvec3(a.x, a.y, a.z), {b.x, a.y, a.z}, {b.x, a.y, b.z}, {a.x, a.y, b.z}});
  add_quad(part, {glm::dvec3(a.x, b.y, a.z), {a.x, b.y, b.z}, {b.x, b.y, b.z}, {b.x, b.y, a.z}});
  add_quad(part, {glm::dvec3(a.x, a.y, a.z), {a.x, a.y, b.z}, {a.x, b.y, b.z}, {a.x, b.y, a.z}});
  add_quad(part, {glm::dvec3(b.x, a.y, a.z), {b.x, b.y, a.z}, {b.x, b.y, b.z}, {b.x, a.y, b.z}});
}

inline Scene scene_of(MeshPart part) {
  Scene scene;
  scene.parts.push_back(std::move(part));
  return scene;
}

struct SoupOptions {
  int count = 1000;
  double extent = 64;    // of the box, from 0
  double size_max = 16;  // of a triangle
  bool colors = false;
};
// Every kind of trouble: slivers, triangles without area, coordinates on grid planes and on cell
// centres, tiny and large ones. Coordinates are multiples of 1/1024, so that whole translations are
// exact. The same seed gives the same soup.
Scene soup(uint64_t seed, const SoupOptions& options);

}  // namespace voxeld::pipelines
