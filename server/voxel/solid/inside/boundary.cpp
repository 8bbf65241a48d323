#include "server/voxel/solid/inside/boundary.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/base/pieces.h"

namespace voxeld {
namespace {

bool comes_first(const glm::ivec3& a, const glm::ivec3& b) {
  return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
}

// A table with open addressing that gives equal positions equal numbers.
class PointNumbers {
 public:
  explicit PointNumbers(size_t count_max) {
    size_t slots = 16;
    while (slots < 2 * count_max) slots *= 2;
    resize_in_pieces(slots_, slots, kEmpty);
  }

  uint32_t number_of(const glm::ivec3& q) {
    cancel_point();
    const size_t mask = slots_.size() - 1;
    size_t slot = hash_of(q) & mask;
    while (slots_[slot] != kEmpty) {
      if (points_[slots_[slot]] == q) return slots_[slot];
      slot = (slot + 1) & mask;
    }
    slots_[slot] = static_cast<uint32_t>(points_.size());
    push_in_pieces(points_, q);
    return slots_[slot];
  }
  const std::vector<glm::ivec3>& points() const { return points_; }

 private:
  static constexpr uint32_t kEmpty = 0xffffffffu;

  // Finalizer of splitmix64 (Steele, Lea, Flood 2014).
  static size_t hash_of(const glm::ivec3& q) {
    uint64_t hash = static_cast<uint32_t>(q.x) | uint64_t{static_cast<uint32_t>(q.y)} << 32;
    hash = (hash ^ (hash >> 30)) * 0xbf58476d1ce4e5b9ull;
    hash += static_cast<uint32_t>(q.z);
    hash = (hash ^ (hash >> 27)) * 0x94d049bb133111ebull;
    return hash ^ (hash >> 31);
  }

  std::vector<uint32_t> slots_;
  std::vector<glm::ivec3> points_;
};

// An edge, stored at its end with the lower number; `high` is the other end.
struct HalfEdge {
  uint32_t high;
  int32_t direction;  // 1: from the lower number to the higher
};

}  // namespace

std::vector<BoundaryEdge> boundary_edges(const FillMesh& mesh) {
  const size_t triangles = mesh.triangle_count();
  PointNumbers numbers(std::min<size_t>(3 * triangles, size_t{1} << 31));
  std::vector<std::array<uint32_t, 3>> corners;
  corners.reserve(triangles);
  for (size_t t = 0; t < triangles; ++t) {
    cancel_point();
    const auto q = mesh.corners(t);
    corners.push_back({numbers.number_of(q[0]), numbers.number_of(q[1]), numbers.number_of(q[2])});
  }
  const std::vector<glm::ivec3>& points = numbers.points();
  const auto for_each_edge = [&](const auto& visit) {
    for (const auto& c : corners) {
      cancel_point();
      for (size_t i = 0; i < 3; ++i) {
        const uint32_t from = c[i], to = c[(i + 1) % 3];
        if (from != to) visit(std::min(from, to), std::max(from, to), from < to ? 1 : -1);
      }
    }
  };
  std::vector<size_t> first;
  resize_in_pieces(first, points.size() + 1);
  for_each_edge([&](uint32_t low, uint32_t, int) { ++first[low + 1]; });
  for (size_t i = 0; i < points.size(); ++i) {
    cancel_point_at(i);
    first[i + 1] += first[i];
  }
  std::vector<HalfEdge> edges;
  resize_in_pieces(edges, first.back());
  std::vector<size_t> place = copied_in_pieces(first.data(), points.size());
  for_each_edge([&](uint32_t low, uint32_t high, int direction) {
    edges[place[low]++] = {high, direction};
  });
  std::vector<BoundaryEdge> boundary;
  for (uint32_t low = 0; low < points.size(); ++low) {
    cancel_point();
    const auto begin = edges.begin() + static_cast<ptrdiff_t>(first[low]);
    const auto end = edges.begin() + static_cast<ptrdiff_t>(first[low + 1]);
    cancellable_sort(begin, end,
                     [](const HalfEdge& a, const HalfEdge& b) { return a.high < b.high; });
    for (auto edge = begin; edge != end;) {
      const uint32_t high = edge->high;
      int count = 0;
      for (; edge != end && edge->high == high; ++edge) count += edge->direction;
      if (count > 0) push_in_pieces(boundary, {points[low], points[high], count});
      if (count < 0) push_in_pieces(boundary, {points[high], points[low], -count});
    }
  }
  cancellable_sort(boundary.begin(), boundary.end(),
                   [](const BoundaryEdge& a, const BoundaryEdge& b) {
                     if (a.from != b.from) return comes_first(a.from, b.from);
                     return comes_first(a.to, b.to);
                   });
  return boundary;
}

std::vector<glm::ivec3> closing_cones(const std::vector<BoundaryEdge>& boundary) {
  PointNumbers numbers(2 * boundary.size());
  std::vector<std::pair<uint32_t, uint32_t>> ends;
  ends.reserve(boundary.size());
  for (const BoundaryEdge& edge : boundary) {
    cancel_point();
    const uint32_t from = numbers.number_of(edge.from);
    ends.emplace_back(from, numbers.number_of(edge.to));
  }
  std::vector<uint32_t> root = numbers_in_pieces(numbers.points().size());
  const auto find = [&](uint32_t a) {
    while (root[a] != a) a = root[a] = root[root[a]];
    return a;
  };
  for (const auto& [from, to] : ends) {
    cancel_point();
    root[find(from)] = find(to);
  }
  struct Sum {
    std::array<int64_t, 3> q{};
    int64_t count = 0;
  };
  std::vector<Sum> sums;
  resize_in_pieces(sums, root.size());
  for (uint32_t i = 0; i < root.size(); ++i) {
    cancel_point();
    Sum& sum = sums[find(i)];
    for (int axis = 0; axis < 3; ++axis) {
      sum.q[static_cast<size_t>(axis)] += numbers.points()[i][axis];
    }
    ++sum.count;
  }
  std::vector<glm::ivec3> cones;
  for (size_t e = 0; e < boundary.size(); ++e) {
    cancel_point();
    const Sum& sum = sums[find(ends[e].first)];
    glm::ivec3 apex;
    for (int axis = 0; axis < 3; ++axis) {
      apex[axis] = static_cast<int>(sum.q[static_cast<size_t>(axis)] / sum.count);
    }
    for (int i = 0; i < boundary[e].count; ++i) {
      for (const glm::ivec3& corner : {boundary[e].to, boundary[e].from, apex}) {
        push_in_pieces(cones, corner);
      }
    }
  }
  return cones;
}

}  // namespace voxeld
