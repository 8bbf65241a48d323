#include "tests/bench/waves.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include <glm/geometric.hpp>

namespace voxeld {
namespace {

// Points of the unit sphere by halving the edges of an icosahedron.
class Subdivision {
 public:
  Subdivision() {
    const double golden = (1.0 + std::sqrt(5.0)) / 2.0;
    for (int axis = 0; axis < 3; ++axis) {
      for (const double a : {-1.0, 1.0}) {
        for (const double b : {-golden, golden}) {
          glm::dvec3 p(0.0);
          p[axis] = a;
          p[(axis + 1) % 3] = b;
          points.push_back(glm::normalize(p));
        }
      }
    }
    // Faces are the triples of neighbours: points at the least distance from each other.
    const double side = 1.1 * 2.0 / std::sqrt(1.0 + golden * golden);
    const auto near = [&](size_t i, size_t j) {
      return glm::distance(points[i], points[j]) < side;
    };
    for (uint32_t i = 0; i < points.size(); ++i) {
      for (uint32_t j = i + 1; j < points.size(); ++j) {
        for (uint32_t k = j + 1; k < points.size(); ++k) {
          if (!near(i, j) || !near(j, k) || !near(i, k)) continue;
          const glm::dvec3 normal = glm::cross(points[j] - points[i], points[k] - points[i]);
          const bool outward = glm::dot(normal, points[i]) > 0;
          triangles.push_back({i, outward ? j : k, outward ? k : j});
        }
      }
    }
  }

  void halve() {
    std::vector<std::array<uint32_t, 3>> finer;
    for (const auto& [a, b, c] : triangles) {
      const uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    triangles = std::move(finer);
  }

  std::vector<glm::dvec3> points;
  std::vector<std::array<uint32_t, 3>> triangles;

 private:
  uint32_t middle(uint32_t a, uint32_t b) {
    const auto [entry, added] = middles_.try_emplace(std::pair(std::min(a, b), std::max(a, b)),
                                                     static_cast<uint32_t>(points.size()));
    if (added) points.push_back(glm::normalize(points[a] + points[b]));
    return entry->second;
  }

  std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles_;
};

}  // namespace

Scene wavy_sphere(int levels) {
  Subdivision sphere;
  for (int level = 0; level < levels; ++level) sphere.halve();
  Scene scene;
  scene.format = "made";
  MeshPart part;
  for (const glm::dvec3& p : sphere.points) {
    const double wave = std::sin(7.0 * p.x) * std::sin(6.0 * p.y + 1.0) * std::sin(5.0 * p.z + 2.0);
    part.positions.push_back(p * (1.0 + 0.3 * wave));
  }
  for (const auto& triangle : sphere.triangles) {
    part.indices.insert(part.indices.end(), triangle.begin(), triangle.end());
  }
  scene.parts.push_back(std::move(part));
  return scene;
}

}  // namespace voxeld
