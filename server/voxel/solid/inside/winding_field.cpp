#include "server/voxel/solid/inside/winding_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <tuple>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "server/base/cancel_point.h"
#include "server/base/pieces.h"

namespace voxeld {
namespace {

__extension__ using Wide = __int128;

constexpr uint32_t kLeafTriangles = 4;
// From kFarRadii on, as a part of the most that a node can add, A / (4 pi d^2).
constexpr double kFarError = 1.0 / 16;
constexpr double kJump = 1e300;
// Bound of the rounding error in sums of a few thousand angles.
constexpr double kRounding = 1e-9;

std::tuple<int64_t, int64_t, int64_t> key_of(const glm::i64vec3& p) {
  return {p.x, p.y, p.z};
}

glm::dvec3 to_double(const glm::i64vec3& p) {
  return glm::dvec3(p);
}

// Six times the volume of (0, a, b, c). A point in the triangle's plane counts like one slightly
// further along z, then along x, then y. Crossings break ties the same way.
double signed_volume(const glm::i64vec3& a, const glm::i64vec3& b, const glm::i64vec3& c) {
  const glm::dvec3 da = to_double(a), db = to_double(b), dc = to_double(c);
  const double volume = glm::dot(da, glm::cross(db, dc));
  const double scale = glm::length(da) * glm::length(db) * glm::length(dc);
  if (std::abs(volume) > 1e-14 * scale) return volume;
  const glm::i64vec3 e = b - a, f = c - a;
  const auto product = [](int64_t x, int64_t y) { return static_cast<Wide>(x) * y; };
  const std::array<Wide, 3> n = {product(e.y, f.z) - product(e.z, f.y),
                                 product(e.z, f.x) - product(e.x, f.z),
                                 product(e.x, f.y) - product(e.y, f.x)};
  const Wide exact = n[0] * a.x + n[1] * a.y + n[2] * a.z;
  if (exact != 0) return static_cast<double>(exact);
  // The point moves by +z, so the corners, seen from it, move by -z.
  const Wide tie = n[2] != 0 ? -n[2] : n[0] != 0 ? -n[0] : -n[1];
  return tie < 0 ? -0.0 : 0.0;
}

// The solid angle of the triangle as seen from the origin, over 4 pi. It is positive if the
// triangle faces away from the origin. van Oosterom & Strackee 1983, "The solid angle of a plane
// triangle".
double solid_angle(const glm::i64vec3& a, const glm::i64vec3& b, const glm::i64vec3& c) {
  const glm::dvec3 da = to_double(a), db = to_double(b), dc = to_double(c);
  const double la = glm::length(da), lb = glm::length(db), lc = glm::length(dc);
  const double denominator =
      la * lb * lc + glm::dot(da, db) * lc + glm::dot(db, dc) * la + glm::dot(dc, da) * lb;
  return 2 * std::atan2(signed_volume(a, b, c), denominator) / (4 * std::numbers::pi);
}

double distance_to_segment(const glm::dvec3& a, const glm::dvec3& b) {
  const glm::dvec3 along = b - a;
  const double squared = glm::dot(along, along);
  const double t = squared > 0 ? std::clamp(-glm::dot(a, along) / squared, 0.0, 1.0) : 0.0;
  return glm::length(a + t * along);
}

// Distance from the origin.
double distance_to_triangle(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  const glm::dvec3 normal = glm::cross(b - a, c - a);
  const double squared = glm::dot(normal, normal);
  const auto beside = [&](const glm::dvec3& from, const glm::dvec3& to) {
    return glm::dot(glm::cross(to - from, -from), normal) < 0;
  };
  if (squared > 0 && !beside(a, b) && !beside(b, c) && !beside(c, a)) {
    return std::abs(glm::dot(a, normal)) / std::sqrt(squared);
  }
  return std::min(
      {distance_to_segment(a, b), distance_to_segment(b, c), distance_to_segment(c, a)});
}

int threshold_of(double c) {
  return static_cast<int>(std::floor(0.5 + c)) + 1;
}

}  // namespace

WindingField::WindingField(const std::vector<glm::ivec3>& triangles, int sub_voxel_bits,
                           double far_radii)
    : half_cell_(int64_t{1} << sub_voxel_bits), far_radii_(far_radii) {
  const auto point = [](const glm::ivec3& q) { return glm::i64vec3(q) * int64_t{2} + int64_t{1}; };
  for (size_t i = 0; i + 2 < triangles.size(); i += 3) {
    cancel_point();
    const Triangle t = {point(triangles[i]), point(triangles[i + 1]), point(triangles[i + 2])};
    if (t.a != t.c && t.b != t.c) push_in_pieces(triangles_, t);
  }
  if (!triangles_.empty()) build(0, static_cast<uint32_t>(triangles_.size()));
}

int64_t WindingField::bytes_for(int64_t triangles) {
  // Lists grow by copies, and leaves hold two triangles or more.
  constexpr int64_t kCornerBytes = 3 * sizeof(glm::ivec3);
  return triangles * (kCornerBytes + 2 * static_cast<int64_t>(sizeof(Triangle) + sizeof(Node)));
}

// The order along an axis. Triangles that face the other way have the same one.
bool WindingField::comes_before(const Triangle& a, const Triangle& b, int axis) {
  cancel_point();
  const int64_t middle_a = a.a[axis] + a.b[axis] + a.c[axis];
  const int64_t middle_b = b.a[axis] + b.b[axis] + b.c[axis];
  if (middle_a != middle_b) return middle_a < middle_b;
  const auto [a_low, a_high] = std::minmax({key_of(a.b), key_of(a.c)});
  const auto [b_low, b_high] = std::minmax({key_of(b.b), key_of(b.c)});
  return std::tuple(key_of(a.a), a_low, a_high, key_of(a.b)) <
         std::tuple(key_of(b.a), b_low, b_high, key_of(b.b));
}

// Every sum is over a leaf in order, or over two children: it does not depend on how a library
// selects the lower half.
uint32_t WindingField::build(uint32_t first, uint32_t count) {
  const auto index = static_cast<uint32_t>(nodes_.size());
  Node node = {first, count, 0, glm::dvec3(0), glm::dvec3(0), 0, 0, 0};
  push_in_pieces(nodes_, node);
  const auto begin = triangles_.begin() + first, end = begin + count;
  glm::i64vec3 low = begin->a, high = begin->a;
  for (auto t = begin; t != end; ++t) {
    cancel_point();
    low = glm::min(low, glm::min(t->a, glm::min(t->b, t->c)));
    high = glm::max(high, glm::max(t->a, glm::max(t->b, t->c)));
  }
  glm::dvec3 weighted(0);
  if (count <= kLeafTriangles) {
    cancellable_sort(begin, end,
                     [](const Triangle& a, const Triangle& b) { return comes_before(a, b, 0); });
    for (auto t = begin; t != end; ++t) {
      const glm::dvec3 a = to_double(t->a), b = to_double(t->b), c = to_double(t->c);
      const glm::dvec3 normal = 0.5 * glm::cross(b - a, c - a);
      const double area = glm::length(normal);
      node.dipole += normal;
      node.area += area;
      node.rim += glm::length(b - a);
      weighted += area * (a + b + c) / 3.0;
    }
  } else {
    const glm::i64vec3 size = high - low;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    std::nth_element(begin, begin + count / 2, end, [axis](const Triangle& a, const Triangle& b) {
      return comes_before(a, b, axis);
    });
    build(first, count / 2);
    node.second = build(first + count / 2, count - count / 2);
    for (const Node* child : {&nodes_[index + 1], &nodes_[node.second]}) {
      node.dipole += child->dipole;
      node.area += child->area;
      node.rim += child->rim;
      weighted += child->area * child->centre;
    }
  }
  node.centre = node.area > 0 ? weighted / node.area : 0.5 * (to_double(low) + to_double(high));
  double squared = 0;
  for (auto t = begin; t != end; ++t) {
    cancel_point();
    for (const glm::i64vec3& p : {t->a, t->b, t->c}) {
      const glm::dvec3 offset = to_double(p) - node.centre;
      squared = std::max(squared, glm::dot(offset, offset));
    }
  }
  node.radius = std::sqrt(squared);
  nodes_[index] = node;
  return index;
}

// Bounds the gradient of c in two ways, with d the distance from the cube. First, a triangle of
// area A is a sheet of dipoles: it adds at most A / (2 pi d^3). Second, the gradient of a solid
// angle is an integral over the rim alone (Biot-Savart), in which the cones' inner sides cancel
// out. An edge of length L adds at most min(L / d^2, pi / d) / (4 pi).
bool WindingField::add_change(const Triangle& triangle, const glm::dvec3& at, double half_diagonal,
                              Change& change) const {
  const glm::dvec3 a = to_double(triangle.a) - at, b = to_double(triangle.b) - at,
                   c = to_double(triangle.c) - at;
  const double to_triangle = distance_to_triangle(a, b, c) - half_diagonal;
  if (to_triangle <= 0) return false;
  const double area = 0.5 * glm::length(glm::cross(b - a, c - a));
  change.by_area +=
      area * half_diagonal / (2 * std::numbers::pi * to_triangle * to_triangle * to_triangle);
  // The rim is part of the triangle, so to_rim > 0.
  const double to_rim = distance_to_segment(a, b) - half_diagonal;
  change.by_rim += half_diagonal / (4 * std::numbers::pi) *
                   std::min(glm::length(b - a) / to_rim, std::numbers::pi) / to_rim;
  return true;
}

WindingField::Value WindingField::value(const glm::i64vec3& p, double half_diagonal) const {
  Value value;
  if (nodes_.empty()) return value;
  const glm::dvec3 at = to_double(p);
  Change change;
  std::array<uint32_t, 64> stack;
  size_t depth = 0;
  stack[depth++] = 0;
  for (size_t step = 1; depth > 0; ++step) {
    cancel_point_at(step);
    const uint32_t index = stack[--depth];
    const Node& node = nodes_[index];
    const glm::dvec3 offset = node.centre - at;
    const double distance = glm::length(offset);
    const double nearest = distance - node.radius - half_diagonal;
    if (distance > far_radii_ * node.radius + half_diagonal && nearest > 0) {
      const double squared = nearest * nearest;
      value.c +=
          glm::dot(node.dipole, offset) / (4 * std::numbers::pi * distance * distance * distance);
      change.by_area += node.area * half_diagonal / (2 * std::numbers::pi * squared * nearest);
      change.by_rim += node.rim * half_diagonal / (4 * std::numbers::pi * squared);
      change.far_error += kFarError * node.area / (4 * std::numbers::pi * squared);
      continue;
    }
    if (node.second != 0) {
      stack[depth++] = node.second;
      stack[depth++] = index + 1;
      continue;
    }
    for (uint32_t t = node.first; t < node.first + node.count; ++t) {
      const Triangle& triangle = triangles_[t];
      if (half_diagonal > 0 && !add_change(triangle, at, half_diagonal, change)) {
        return {0, kJump};
      }
      value.c += solid_angle(triangle.a - p, triangle.b - p, triangle.c - p);
    }
  }
  value.change = std::min(change.by_area, change.by_rim) + change.far_error;
  return value;
}

glm::i64vec3 WindingField::centre(const glm::ivec3& first, int side) const {
  return glm::i64vec3(first) * (2 * half_cell_) + int64_t{side} * half_cell_;
}

int WindingField::threshold(const glm::ivec3& cell) const {
  return threshold_of(value(centre(cell, 1), 0).c);
}

std::optional<int> WindingField::threshold(const glm::ivec3& first, int side) const {
  const double half_diagonal = std::sqrt(3.0) * static_cast<double>((side - 1) * half_cell_);
  const Value v = value(centre(first, side), half_diagonal);
  if (v.change >= 1) return std::nullopt;
  const int low = threshold_of(v.c - v.change - kRounding);
  const int high = threshold_of(v.c + v.change + kRounding);
  if (low != high) return std::nullopt;
  return low;
}

}  // namespace voxeld
