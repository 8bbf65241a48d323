#include "tests/unit/voxel_solid/solid_scenes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace voxeld::solid_test {

Scene scene_of(const std::vector<reference::Triangle>& triangles) {
  Scene scene;
  MeshPart part;
  for (const auto& triangle : triangles) {
    for (const auto& p : triangle) {
      part.indices.push_back(static_cast<uint32_t>(part.positions.size()));
      part.positions.emplace_back(p[0], p[1], p[2]);
    }
  }
  scene.parts.push_back(std::move(part));
  return scene;
}

std::vector<reference::Triangle> triangles_of(const Scene& scene) {
  std::vector<reference::Triangle> triangles;
  for (const MeshPart& part : scene.parts) {
    for (size_t i = 0; i + 2 < part.indices.size(); i += 3) {
      reference::Triangle triangle;
      for (size_t k = 0; k < 3; ++k) {
        const glm::dvec3& p = part.positions[part.indices[i + k]];
        triangle[k] = {p.x, p.y, p.z};
      }
      triangles.push_back(triangle);
    }
  }
  return triangles;
}

Scene moved(const Scene& scene, const std::function<glm::dvec3(const glm::dvec3&)>& move) {
  Scene out = scene;
  for (MeshPart& part : out.parts) {
    for (glm::dvec3& p : part.positions) p = move(p);
  }
  return out;
}

Scene without(const Scene& scene, const std::function<bool(const glm::dvec3& centre)>& drop) {
  auto triangles = triangles_of(scene);
  std::erase_if(triangles, [&](const reference::Triangle& t) {
    return drop({(t[0][0] + t[1][0] + t[2][0]) / 3, (t[0][1] + t[1][1] + t[2][1]) / 3,
                 (t[0][2] + t[1][2] + t[2][2]) / 3});
  });
  return scene_of(triangles);
}

Scene joined(const Scene& a, const Scene& b) {
  Scene out = a;
  out.parts.insert(out.parts.end(), b.parts.begin(), b.parts.end());
  return out;
}

Scene box(const glm::dvec3& min, const glm::dvec3& max) {
  Scene scene;
  MeshPart part;
  for (int i = 0; i < 8; ++i) {
    part.positions.emplace_back((i & 1) != 0 ? max.x : min.x, (i & 2) != 0 ? max.y : min.y,
                                (i & 4) != 0 ? max.z : min.z);
  }
  part.indices = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                  2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
  scene.parts.push_back(std::move(part));
  return scene;
}

Scene soup(int count, const glm::dvec3& size, unsigned seed) {
  std::mt19937 random(seed);
  const auto unit = [&] { return static_cast<double>(random()) / 4294967296.0; };
  std::vector<reference::Triangle> triangles;
  for (int t = 0; t < count; ++t) {
    const double extent = t % 2 == 0 ? 1.0 : 0.1;
    const glm::dvec3 at(unit(), unit(), unit());
    reference::Triangle triangle;
    for (auto& corner : triangle) {
      for (int c = 0; c < 3; ++c) {
        const double p = at[c] + extent * (unit() - 0.5);
        corner[static_cast<size_t>(c)] = std::clamp(p, 0.0, 1.0) * size[c];
      }
    }
    triangles.push_back(triangle);
  }
  return scene_of(triangles);
}

VoxelizeOptions solid(Sign sign) {
  VoxelizeOptions options;
  options.fill = Fill::kSolid;
  options.sign = sign;
  options.rule = Rule::kNone;
  options.color = ColorMode::kNone;
  return options;
}

void set_bounds(VoxelizeOptions& options, const glm::dvec3& min, const glm::dvec3& max) {
  options.placement.size.reset();
  options.placement.voxel_size = {1.0, 1.0, 1.0};
  options.placement.bounds = {min.x, min.y, min.z, max.x, max.y, max.z};
}

Grid voxelized(const Scene& scene, const VoxelizeOptions& options, VoxelizeStats* stats,
               int threads) {
  Voxelizer voxelizer(nullptr, threads);
  auto grid = voxelizer.voxelize(scene, options, {}, stats);
  EXPECT_TRUE(grid.ok()) << grid.error().message();
  return grid.ok() ? std::move(grid).value() : Grid();
}

OracleGrid oracle_grid(const Grid& grid) {
  const GridSpec& spec = grid.spec;
  return {{spec.dims.x, spec.dims.y, spec.dims.z},
          {spec.origin_world.x, spec.origin_world.y, spec.origin_world.z},
          {spec.voxel_size.x, spec.voxel_size.y, spec.voxel_size.z}};
}

Occupancy cells_of(const Grid& grid) {
  const glm::ivec3& dims = grid.spec.dims;
  Occupancy cells(static_cast<size_t>(grid.spec.cell_count()));
  size_t beside = 0;
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t) {
      if (x >= dims.x || y >= dims.y || z >= dims.z) {
        ++beside;
        return;
      }
      cells[static_cast<size_t>(x) + static_cast<size_t>(dims.x) *
                                         (static_cast<size_t>(y) + static_cast<size_t>(dims.y) *
                                                                       static_cast<size_t>(z))] = 1;
    });
  }
  EXPECT_EQ(beside, 0u) << "cells beside the grid";
  return cells;
}

size_t differences(const Occupancy& a, const Occupancy& b) {
  EXPECT_EQ(a.size(), b.size());
  size_t count = 0;
  for (size_t i = 0; i < std::min(a.size(), b.size()); ++i) count += a[i] != b[i];
  return count;
}

}  // namespace voxeld::solid_test
