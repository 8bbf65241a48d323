// A scene of many parts, and what its ids must be by the oracle, for tests of every pipeline.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "server/grid/grid.h"
#include "server/scene/core/scene.h"
#include "server/voxel/attributes/id_fold.h"
#include "tests/reference/id_oracle.h"

namespace voxeld::test {

// Balls of about 20 units that reach into each other, each a mesh of six gores, which are groups.
// Two nodes; materials change from gore to gore, and some have none.
inline Scene gored_balls() {
  constexpr int kBalls = 6, kGores = 6, kAround = 4, kAlong = 24;
  Scene scene;
  scene.materials.resize(3);
  scene.meshes.clear();
  scene.groups.clear();
  scene.nodes = {"near", "far"};
  for (int ball = 0; ball < kBalls; ++ball) {
    scene.meshes.push_back("ball " + std::to_string(ball));
    const glm::dvec3 middle(22 + 9 * (ball % 3), 22 + 13 * (ball / 3), 20 + 1.5 * ball);
    for (int gore = 0; gore < kGores; ++gore) {
      MeshPart& part = scene.parts.emplace_back();
      part.mesh = static_cast<uint32_t>(ball);
      part.node = static_cast<uint32_t>(ball % 2);
      part.group = static_cast<uint32_t>(scene.groups.size());
      part.material = (ball + gore) % 4 - 1;
      scene.groups.push_back("gore " + std::to_string(scene.groups.size()));
      for (int u = 0; u <= kAround; ++u) {
        for (int v = 0; v <= kAlong; ++v) {
          const double longitude =
              2 * std::numbers::pi * (gore + double(u) / kAround) / kGores + 0.2 * ball;
          const double latitude = std::numbers::pi * v / kAlong;
          part.positions.push_back(
              middle + (15.0 + ball) * glm::dvec3(std::sin(latitude) * std::cos(longitude),
                                                  std::cos(latitude),
                                                  std::sin(latitude) * std::sin(longitude)));
        }
      }
      for (uint32_t u = 0; u < kAround; ++u) {
        for (uint32_t v = 0; v < kAlong; ++v) {
          const uint32_t a = u * (kAlong + 1) + v, b = a + kAlong + 1;
          part.indices.insert(part.indices.end(), {a, b, b + 1, a, b + 1, a + 1});
        }
      }
    }
  }
  return scene;
}

// Expects that the id of each voxel is one whose surface in it is the largest, or smaller by at
// most 0.4 of a cell's face: the lattice of 4 x 4 points measures each side of a border to about
// 0.2. So it is the largest one wherever that leads by more. part_ids: the ids that parts should
// have.
inline void expect_largest_ids(const Grid& grid, Channel channel, const Scene& scene,
                               const std::vector<int>& part_ids, const std::string& what) {
  constexpr double kTolerance = 0.4;
  std::vector<reference::Triangle> triangles;
  std::vector<int> ids;
  for (size_t p = 0; p < scene.parts.size(); ++p) {
    const MeshPart& part = scene.parts[p];
    for (size_t i = 0; i < part.indices.size(); i += 3) {
      reference::Triangle& triangle = triangles.emplace_back();
      for (size_t k = 0; k < 3; ++k) {
        for (int c = 0; c < 3; ++c) triangle[k][c] = part.positions[part.indices[i + k]][c];
      }
      ids.push_back(part_ids[p]);
    }
  }
  const GridSpec& spec = grid.spec;
  const auto areas =
      reference::areas_by_id(triangles, ids,
                             {{spec.dims.x, spec.dims.y, spec.dims.z},
                              {spec.origin_world.x, spec.origin_world.y, spec.origin_world.z},
                              {spec.voxel_size.x, spec.voxel_size.y, spec.voxel_size.z}});
  size_t wrong = 0, mixed = 0, clear = 0, exact = 0, checked = 0;
  for (SparseTile tile : grid.tiles) {
    const std::vector<uint16_t> samples = id_samples(tile, channel);
    ASSERT_EQ(samples.size(), tile.voxel_count()) << what;
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      const auto found = areas.find(
          static_cast<size_t>(x + int64_t{spec.dims.x} * (y + int64_t{spec.dims.y} * z)));
      if (found == areas.end()) return;  // touched without area
      ++checked;
      const reference::AreaById& in_cell = found->second;
      const auto got = in_cell.find(samples[voxel]);
      double largest = 0, second = 0;
      for (const auto& [id, area] : in_cell) {
        second = std::max(second, std::min(area, largest));
        largest = std::max(largest, area);
      }
      const double area = got == in_cell.end() ? -1 : got->second;
      wrong += area < largest - kTolerance ? 1 : 0;
      mixed += in_cell.size() > 1 ? 1 : 0;
      clear += in_cell.size() > 1 && largest - second > kTolerance ? 1 : 0;
      exact += in_cell.size() > 1 && area == largest ? 1 : 0;
    });
  }
  EXPECT_EQ(wrong, 0u) << what << " of " << checked;
  EXPECT_GT(checked, 3000u) << what;
  EXPECT_GT(mixed, 300u) << what;
  // Near-ties, which may go either way, are a part of the mixed cells, and few of them do.
  EXPECT_GT(2 * clear, mixed) << what << ": " << clear << " of " << mixed;
  EXPECT_GT(10 * exact, 9 * mixed) << what << ": " << exact << " of " << mixed;
}

}  // namespace voxeld::test
