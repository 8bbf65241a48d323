// A search tree for the triangle that is nearest to a point.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "server/voxel/solid/inside/fill_mesh.h"

namespace voxeld {

// A hierarchy without pointers: boxes of four triangles, of four of these, and so on. Triangles are
// in Morton order of the middles of their boxes. Any number of threads may search at a time. About
// 90 bytes for each triangle.
class TriangleTree {
 public:
  static constexpr uint32_t kNone = UINT32_MAX;
  struct Nearest {
    double squared = 1e300;  // squared distance; that of the limit if there is no triangle
    uint32_t triangle = kNone;
  };

  explicit TriangleTree(const FillMesh& mesh);

  // The lengths of a voxel's edges in the unit of distances, each 1 or more; (1, 1, 1) at first.
  void set_scale(const glm::dvec3& scale) { scale_ = scale; }
  const glm::dvec3& scale() const { return scale_; }

  // The triangle nearest to p, at most `limit` away. near: a triangle to try first; it does not
  // change `squared`. p is in 1/512 voxel and within a grid; distances are in 1/512 of their unit.
  Nearest find(const glm::ivec3& p, double limit, uint32_t near) const;

  // Triangles that can be nearest to a point of a ball, for find_among().
  struct Candidates;
  // Gathers the candidates of the ball around p. Only points at most `limit` from a triangle
  // matter. Returns the triangle nearest to p; none if the ball has no such points.
  Nearest gather(const glm::ivec3& p, double radius, double limit, uint32_t near,
                 Candidates& candidates) const;
  // Same as find(), for points of the ball.
  Nearest find_among(const Candidates& candidates, const glm::ivec3& p, double limit,
                     uint32_t near) const;

  static int64_t bytes_for(int64_t triangles) { return triangles * 90; }

 private:
  // Boxes of four children in 1/512 voxel, rounded outwards. Empty boxes are +inf to -inf.
  using Float4 = float __attribute__((vector_size(16)));
  struct Boxes {
    std::array<Float4, 3> min, max;
  };
  struct Entry {
    float squared;  // squared distance to its box
    uint32_t level, node;
  };
  static constexpr size_t kStackMax = 3 * 16 + 1;  // enough for 4^16 triangles

  static Boxes no_boxes();
  Float4 squared_to_boxes(const Boxes& boxes, const glm::vec3& p) const;
  double squared_distance(uint32_t triangle, const glm::ivec3& p) const;
  void look_at(uint32_t triangle, const glm::ivec3& p, Nearest& nearest) const;
  Nearest start(const glm::ivec3& p, double limit, uint32_t near) const;
  // Calls leaf(first_triangle, boxes, squared) for each group of four triangles with a box within
  // limit(), nearest groups first.
  template <typename Limit, typename Leaf>
  void walk(const glm::ivec3& p, const Limit& limit, const Leaf& leaf) const;
  void add_level();

  std::vector<std::array<glm::ivec3, 3>> triangles_;  // q, corners in ascending order
  std::vector<std::vector<Boxes>> levels_;            // levels_[0]: boxes of triangles
  glm::dvec3 scale_{1.0};
};

struct TriangleTree::Candidates {
  std::vector<Boxes> boxes;         // one per four triangles
  std::vector<uint32_t> triangles;  // in the same order
};

}  // namespace voxeld
