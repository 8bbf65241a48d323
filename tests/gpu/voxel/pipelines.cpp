#include "tests/gpu/voxel/pipelines.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace voxeld::pipelines {

Scene soup(uint64_t seed, const SoupOptions& options) {
  std::mt19937_64 random(seed);
  const auto uniform = [&](double a, double b) {
    return a + (b - a) * static_cast<double>(random() >> 11) * 0x1p-53;
  };
  MeshPart part;
  for (int t = 0; t < options.count; ++t) {
    const int kind = t % 10;
    const double size = std::pow(2.0, uniform(-4, std::log2(options.size_max)));
    const glm::dvec3 c(uniform(0, options.extent), uniform(0, options.extent),
                       uniform(0, options.extent));
    std::array<glm::dvec3, 3> p;
    for (glm::dvec3& corner : p) {
      for (int i = 0; i < 3; ++i) corner[i] = c[i] + uniform(-size, size);
      if (kind == 1 || kind == 2) corner = glm::round(corner);
      if (kind == 3) corner.x = std::round(c.x);
      if (kind == 4) corner.y = std::floor(c.y) + 0.5;
      if (kind == 5) corner.z = std::round(c.z);
    }
    if (kind == 6) p[2] = p[0];
    if (kind == 7) p[1] = p[2] = p[0];
    if (kind == 8) p[2] = p[0] + (p[1] - p[0]) * uniform(0, 1);
    if (kind == 9) p[2] = p[0] + (p[1] - p[0]) * uniform(0, 1) + uniform(-0.02, 0.02);
    for (glm::dvec3& corner : p) {
      for (int i = 0; i < 3; ++i) {
        corner[i] = std::clamp(std::round(corner[i] * 1024) / 1024, 0.0, options.extent);
      }
    }
    add_triangle(part, p[0], p[1], p[2]);
  }
  if (options.colors) {
    for (size_t i = 0; i < part.positions.size(); ++i) {
      part.colors.emplace_back(uniform(0, 1), uniform(0, 1), uniform(0, 1), uniform(0, 1));
    }
  }
  return scene_of(std::move(part));
}

}  // namespace voxeld::pipelines
