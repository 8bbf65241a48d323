// Finds the triangle that is nearest to a point.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "server/voxel/solid/fill_mesh.h"

namespace voxeld {

// Boxes of four triangles, of four of these, and so on, over triangles in Morton order of their
// boxes' middles; so a tree without pointers. Immutable: any number of threads. About 90 bytes for
// each triangle.
class TriangleTree {
 public:
  static constexpr uint32_t kNone = UINT32_MAX;
  struct Nearest {
    double squared = 1e300;  // of the distance; where there is no triangle, of the limit
    uint32_t triangle = kNone;
  };

  explicit TriangleTree(const FillMesh& mesh);

  // The triangle nearest to p, at most `limit` away: `squared` is the same whatever `near` is, a
  // triangle that is looked at first. p: in 1/512 voxel, within a grid, as are all distances.
  Nearest find(const glm::ivec3& p, double limit, uint32_t near) const;

  // Triangles for find_among(): those that can be nearest to a point of a ball.
  struct Candidates;
  // Of the ball around p, of which only points at most `limit` from a triangle matter. Returns
  // what is nearest to p, none where the ball has no such points.
  Nearest gather(const glm::ivec3& p, double radius, double limit, uint32_t near,
                 Candidates& candidates) const;
  // As find(), for points of the ball.
  Nearest find_among(const Candidates& candidates, const glm::ivec3& p, double limit,
                     uint32_t near) const;

  static int64_t bytes_for(int64_t triangles) { return triangles * 90; }

 private:
  // Boxes of four children in 1/512 voxel, rounded outwards; empty ones are +inf to -inf.
  using Float4 = float __attribute__((vector_size(16)));
  struct Boxes {
    std::array<Float4, 3> min, max;
  };
  struct Entry {
    float squared;  // of the distance to its box
    uint32_t level, node;
  };
  static constexpr size_t kStackMax = 3 * 16 + 1;  // 4^16 triangles

  static Boxes no_boxes();
  static Float4 squared_to_boxes(const Boxes& boxes, const glm::vec3& p);
  double squared_distance(uint32_t triangle, const glm::ivec3& p) const;
  void look_at(uint32_t triangle, const glm::ivec3& p, Nearest& nearest) const;
  Nearest start(const glm::ivec3& p, double limit, uint32_t near) const;
  // Calls leaf(first_triangle, boxes, squared) for groups of four triangles, the nearest ones
  // first, of which a box is within limit().
  template <typename Limit, typename Leaf>
  void walk(const glm::ivec3& p, const Limit& limit, const Leaf& leaf) const;
  void add_level();

  std::vector<std::array<glm::ivec3, 3>> triangles_;  // q, corners ascending
  std::vector<std::vector<Boxes>> levels_;            // of triangles first
};

struct TriangleTree::Candidates {
  std::vector<Boxes> boxes;         // of four each
  std::vector<uint32_t> triangles;  // in the same order
};

}  // namespace voxeld
