#include "server/worker/grids/host_estimate.h"

#include <gtest/gtest.h>

#include "server/worker/task/engine.h"

namespace voxeld {
namespace {

TEST(HostEstimate, trees_of_triangles_count_also_where_the_grid_is_smaller_than_the_mesh) {
  constexpr int kSide = 30;
  Scene scene;
  MeshPart& part = scene.parts.emplace_back();
  for (int i = 0; i < kSide * kSide * kSide; ++i) {
    const glm::dvec3 p(i % kSide, i / kSide % kSide, i / kSide / kSide);
    for (const glm::dvec3& corner : {p, p + glm::dvec3(0.3, 0, 0), p + glm::dvec3(0, 0.3, 0)}) {
      part.indices.push_back(static_cast<uint32_t>(part.positions.size()));
      part.positions.push_back(corner);
    }
  }
  const auto count = static_cast<int64_t>(scene.triangle_count());
  const Engine engine(open_device(gpu::DeviceId{.kind = gpu::DeviceKind::kCpu}, "").value());
  const auto bytes = [&](Fill fill, Sign sign, bool measures) {
    RequestOptions options;
    options.voxelize.placement.size = 16;
    options.voxelize.fill = fill;
    options.voxelize.sign = sign;
    options.voxelize.channels.emplace().distance = measures;
    const Placed placed = place_scene(scene, options.voxelize).value();
    return voxelize_bytes(engine, scene, options, placed);
  };
  const int64_t solid = bytes(Fill::kSolid, Sign::kParity, false);
  const int64_t surface = bytes(Fill::kSurface, Sign::kParity, false);
  constexpr int64_t kWindingBytes = 300, kDistanceBytes = 80;  // of a triangle, at the least
  EXPECT_GT(bytes(Fill::kSolid, Sign::kAuto, false), solid + kWindingBytes * count);
  EXPECT_GT(bytes(Fill::kSolid, Sign::kWinding, false), solid + kWindingBytes * count);
  EXPECT_GT(bytes(Fill::kSurface, Sign::kParity, true), surface + kDistanceBytes * count);
  EXPECT_GT(bytes(Fill::kBand, Sign::kParity, false), surface + kDistanceBytes * count);
  EXPECT_GT(bytes(Fill::kSurface, Sign::kAuto, true),
            surface + (kWindingBytes + kDistanceBytes) * count);
}

}  // namespace
}  // namespace voxeld
