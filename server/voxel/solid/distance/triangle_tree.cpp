#include "server/voxel/solid/distance/triangle_tree.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include <glm/common.hpp>

#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/voxel/solid/distance/triangle_distance.h"

namespace voxeld {
namespace {

constexpr size_t kChildren = 4;
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr int kKeyBits = 21;  // bits of the Morton order on each axis

// A triangle's place in Morton order.
struct Place {
  uint64_t key;
  uint32_t triangle;
};

// Spreads 21 bits to every third bit of 63.
uint64_t spread_bits(uint64_t v) {
  v &= 0x1fffff;
  v = (v | v << 32) & 0x1f00000000ffffull;
  v = (v | v << 16) & 0x1f0000ff0000ffull;
  v = (v | v << 8) & 0x100f00f00f00f00full;
  v = (v | v << 4) & 0x10c30c30c30c30c3ull;
  v = (v | v << 2) & 0x1249249249249249ull;
  return v;
}

std::array<glm::ivec3, 3> sorted(std::array<glm::ivec3, 3> corners) {
  std::ranges::sort(corners, [](const glm::ivec3& a, const glm::ivec3& b) {
    return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
  });
  return corners;
}

// 2q + 1 as the next float that is not above it (floor_float) or not below it (ceil_float).
float floor_float(int32_t q) {
  const double exact = 2.0 * q + 1.0;
  const auto rounded = static_cast<float>(exact);
  return rounded > exact ? std::nextafterf(rounded, -FLT_MAX) : rounded;
}
float ceil_float(int32_t q) {
  const double exact = 2.0 * q + 1.0;
  const auto rounded = static_cast<float>(exact);
  return rounded < exact ? std::nextafterf(rounded, FLT_MAX) : rounded;
}

constexpr double kSlack = 1.0;  // margin of bounds in doubles, far above their rounding

// The limit for squared distances to boxes. It exceeds `squared` by more than floats round.
float limit_of_boxes(double squared) {
  return static_cast<float>(std::min(squared * (1 + 1e-5), 1e38));
}

}  // namespace

TriangleTree::TriangleTree(const FillMesh& mesh) {
  const size_t count = mesh.triangle_count();
  if (count == 0) return;
  glm::i64vec3 low(std::numeric_limits<int64_t>::max()), high(std::numeric_limits<int64_t>::min());
  const auto middle = [&](size_t t) {
    const auto v = mesh.corners(t);
    return glm::i64vec3(glm::min(v[0], glm::min(v[1], v[2]))) +
           glm::i64vec3(glm::max(v[0], glm::max(v[1], v[2])));
  };
  for (size_t t = 0; t < count; ++t) {
    cancel_point_at(t);
    low = glm::min(low, middle(t));
    high = glm::max(high, middle(t));
  }
  int shift = 0;
  while ((glm::max(high.x - low.x, glm::max(high.y - low.y, high.z - low.z)) >> shift) >> kKeyBits)
    ++shift;
  std::vector<Place> order;
  order.reserve(count);
  for (size_t t = 0; t < count; ++t) {
    cancel_point_at(t);
    const glm::i64vec3 at = (middle(t) - low) >> int64_t{shift};
    order.push_back({spread_bits(static_cast<uint64_t>(at.x)) |
                         spread_bits(static_cast<uint64_t>(at.y)) << 1 |
                         spread_bits(static_cast<uint64_t>(at.z)) << 2,
                     static_cast<uint32_t>(t)});
  }
  cancellable_sort(order.begin(), order.end(), [](const Place& a, const Place& b) {
    return a.key != b.key ? a.key < b.key : a.triangle < b.triangle;
  });
  triangles_.reserve(count);
  for (const Place& place : order) {
    cancel_point();
    triangles_.push_back(sorted(mesh.corners(place.triangle)));
  }
  do add_level();
  while (levels_.back().size() > 1);
}

void TriangleTree::add_level() {
  const size_t below = levels_.empty() ? triangles_.size() : levels_.back().size();
  std::vector<Boxes> level;
  resize_in_pieces(level, (below + kChildren - 1) / kChildren, no_boxes());
  for (size_t i = 0; i < below; ++i) {
    cancel_point_at(i);
    Boxes& node = level[i / kChildren];
    for (size_t axis = 0; axis < 3; ++axis) {
      float min = kInfinity, max = -kInfinity;
      if (levels_.empty()) {
        const auto& v = triangles_[i];
        const auto a = static_cast<int>(axis);
        min = floor_float(std::min({v[0][a], v[1][a], v[2][a]}));
        max = ceil_float(std::max({v[0][a], v[1][a], v[2][a]}));
      } else {
        for (size_t c = 0; c < kChildren; ++c) {
          min = std::min(min, levels_.back()[i].min[axis][c]);
          max = std::max(max, levels_.back()[i].max[axis][c]);
        }
      }
      node.min[axis][i % kChildren] = min;
      node.max[axis][i % kChildren] = max;
    }
  }
  levels_.push_back(std::move(level));
}

TriangleTree::Boxes TriangleTree::no_boxes() {
  Boxes boxes;
  boxes.min.fill(Float4{} + kInfinity);
  boxes.max.fill(Float4{} - kInfinity);
  return boxes;
}

// Squared distances from a point to the four boxes. Differences of coordinates are stretched, not
// the coordinates, so that the error of floats is a part of the distance.
inline TriangleTree::Float4 TriangleTree::squared_to_boxes(const Boxes& boxes,
                                                           const glm::vec3& p) const {
  const glm::vec3 scale(scale_);
  Float4 squared{};
  for (size_t axis = 0; axis < 3; ++axis) {
    const Float4 below = boxes.min[axis] - p[static_cast<int>(axis)];
    const Float4 above = p[static_cast<int>(axis)] - boxes.max[axis];
    const Float4 beside = below > above ? below : above;
    const Float4 out = (beside > 0 ? beside : Float4{}) * scale[static_cast<int>(axis)];
    squared += out * out;
  }
  return squared;
}

double TriangleTree::squared_distance(uint32_t triangle, const glm::ivec3& p) const {
  const auto& q = triangles_[triangle];
  std::array<glm::dvec3, 3> v;
  for (size_t i = 0; i < 3; ++i) v[i] = glm::dvec3(q[i]) * 2.0 + 1.0 - glm::dvec3(p);
  const bool is_stretched = scale_ != glm::dvec3(1.0);  // most are not, and are measured faster
  return is_stretched ? squared_distance_to_triangle(v, scale_) : squared_distance_to_triangle(v);
}

void TriangleTree::look_at(uint32_t triangle, const glm::ivec3& p, Nearest& nearest) const {
  const double squared = squared_distance(triangle, p);
  const bool is_first = nearest.triangle == kNone && squared <= nearest.squared;
  if (is_first || squared < nearest.squared) nearest = {squared, triangle};
}

TriangleTree::Nearest TriangleTree::start(const glm::ivec3& p, double limit, uint32_t near) const {
  Nearest nearest = {limit * limit, kNone};
  if (near != kNone) look_at(near, p, nearest);
  return nearest;
}

template <typename Limit, typename Leaf>
void TriangleTree::walk(const glm::ivec3& p, const Limit& limit, const Leaf& leaf) const {
  if (levels_.empty()) return;
  std::array<Entry, kStackMax> stack;
  size_t size = 1;
  stack[0] = {0, static_cast<uint32_t>(levels_.size() - 1), 0};
  const glm::vec3 at(p);
  while (size > 0) {
    const Entry entry = stack[--size];
    if (entry.squared > limit()) continue;
    const Boxes& boxes = levels_[entry.level][entry.node];
    const Float4 squared = squared_to_boxes(boxes, at);
    const auto child = static_cast<uint32_t>(entry.node * kChildren);
    if (entry.level == 0) {
      leaf(child, boxes, squared);
      continue;
    }
    const size_t first = size;
    for (uint32_t i = 0; i < kChildren; ++i) {
      if (!(squared[i] <= limit())) continue;
      // Insertion keeps the nearest child last, so that it is visited first.
      size_t place = size++;
      for (; place > first && stack[place - 1].squared < squared[i]; --place) {
        stack[place] = stack[place - 1];
      }
      stack[place] = {squared[i], entry.level - 1, child + i};
    }
  }
}

TriangleTree::Nearest TriangleTree::find(const glm::ivec3& p, double limit, uint32_t near) const {
  Nearest nearest = start(p, limit, near);
  float box_limit = limit_of_boxes(nearest.squared);
  walk(
      p, [&] { return box_limit; },
      [&](uint32_t first, const Boxes&, const Float4& squared) {
        for (uint32_t i = 0; i < kChildren; ++i) {
          if (!(squared[i] <= box_limit) || first + i == near) continue;
          look_at(first + i, p, nearest);
          box_limit = limit_of_boxes(nearest.squared);
        }
      });
  return nearest;
}

TriangleTree::Nearest TriangleTree::gather(const glm::ivec3& p, double radius, double limit,
                                           uint32_t near, Candidates& candidates) const {
  candidates.boxes.clear();
  candidates.triangles.clear();
  Nearest nearest = start(p, limit + radius + kSlack, near);
  // A point of the ball is farther from a triangle than p by at most its distance to p.
  float box_limit = 0, nearest_limit = 0;
  const auto update = [&] {
    const double reach = std::min(std::sqrt(nearest.squared) + 2 * radius, limit + radius) + kSlack;
    box_limit = limit_of_boxes(reach * reach);
    nearest_limit = limit_of_boxes(nearest.squared);
  };
  update();
  walk(
      p, [&] { return box_limit; },
      [&](uint32_t first, const Boxes& boxes, const Float4& squared) {
        for (uint32_t i = 0; i < kChildren; ++i) {
          if (!(squared[i] <= box_limit)) continue;
          const size_t place = candidates.triangles.size() % kChildren;
          if (place == 0) candidates.boxes.push_back(no_boxes());
          for (size_t axis = 0; axis < 3; ++axis) {
            candidates.boxes.back().min[axis][place] = boxes.min[axis][i];
            candidates.boxes.back().max[axis][place] = boxes.max[axis][i];
          }
          candidates.triangles.push_back(first + i);
          if (!(squared[i] <= nearest_limit) || first + i == near) continue;
          look_at(first + i, p, nearest);
          update();
        }
      });
  return nearest;
}

TriangleTree::Nearest TriangleTree::find_among(const Candidates& candidates, const glm::ivec3& p,
                                               double limit, uint32_t near) const {
  Nearest nearest = start(p, limit, near);
  float box_limit = limit_of_boxes(nearest.squared);
  const glm::vec3 at(p);
  for (size_t b = 0; b < candidates.boxes.size(); ++b) {
    const Float4 squared = squared_to_boxes(candidates.boxes[b], at);
    for (size_t i = 0; i < kChildren; ++i) {
      if (!(squared[i] <= box_limit)) continue;
      const uint32_t triangle = candidates.triangles[b * kChildren + i];
      if (triangle == near) continue;
      look_at(triangle, p, nearest);
      box_limit = limit_of_boxes(nearest.squared);
    }
  }
  return nearest;
}

}  // namespace voxeld
