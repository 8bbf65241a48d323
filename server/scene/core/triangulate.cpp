#include "server/scene/core/triangulate.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <tuple>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include "proto/limits.h"
#include "server/base/cancel_point.h"

namespace voxeld {
namespace {

// Twice the signed areas of the polygon's projections (Newell; Sutherland, Sproull & Schumacker
// 1974). They are relative to the first corner, so distant polygons keep their precision.
glm::dvec3 newell_normal(std::span<const glm::dvec3> corners) {
  glm::dvec3 normal{0.0};
  glm::dvec3 previous{0.0};
  for (size_t i = 1; i < corners.size(); ++i) {
    const glm::dvec3 current = corners[i] - corners[0];
    normal += glm::cross(previous, current);
    previous = current;
  }
  return normal;
}

// Projects along the longest axis of the normal; the result turns counter-clockwise. Dropping an
// axis leaves the other coordinates exact, so collinear corners stay collinear.
std::vector<glm::dvec2> project(std::span<const glm::dvec3> corners, const glm::dvec3& normal) {
  const glm::dvec3 size = glm::abs(normal);
  const int dropped = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
  int u = (dropped + 1) % 3, v = (dropped + 2) % 3;
  if (normal[dropped] < 0.0) std::swap(u, v);
  std::vector<glm::dvec2> points(corners.size());
  for (size_t i = 0; i < corners.size(); ++i) points[i] = {corners[i][u], corners[i][v]};
  return points;
}

// Positive if a, b, c turn left.
double orient(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

// Ear clipping (Meisters 1975, "Polygons have ears") with these additions.
//
// Convex corners cannot be inside an ear and are never examined. The others are in a grid of cells,
// so an ear examines only those near it.
//
// A corner that is no ear is examined again only if that can have changed: a neighbour was clipped,
// or the corner that blocked it was clipped or became convex. A polygon with few ears at a time (a
// long band) therefore costs no full round per ear.
//
// Exact duplicates of an ear's corners (the bridges of polygons with holes) block it only if their
// edges enter it. Thousands of corners at one place would make every look expensive. After
// kLooksMin looks, or kLooksPerPlace for each place, the rest becomes a fan.
class EarClipper {
 public:
  EarClipper(std::span<const glm::dvec2> points, std::vector<uint32_t>& out)
      : points_(points), out_(out), left_(static_cast<uint32_t>(points.size())) {
    previous_.resize(left_);
    next_.resize(left_);
    for (uint32_t i = 0; i < left_; ++i) {
      previous_[i] = i == 0 ? left_ - 1 : i - 1;
      next_[i] = i + 1 == left_ ? 0 : i + 1;
    }
    make_cells();
    queued_.resize(left_);
    blocked_by_.resize(left_);
    looks_left_ = std::max(kLooksMin, kLooksPerPlace * place_count(points));
  }

  void run() {
    for (uint32_t i = 0; i < points_.size(); ++i) enqueue(i);
    // Once no corner is an ear, touching corners stop blocking. If there is still no ear, or after
    // kStrictLooksPerCorner looks, the polygon crosses itself and the rest becomes a fan.
    uint32_t ear = 0;
    for (uint64_t looks = kStrictLooksPerCorner * points_.size();;) {
      clip_queued();
      if (left_ <= 3) break;
      ear = left_corner(ear);
      uint32_t looked_at = 0;
      while (looked_at < left_ && looks > 0 && !is_ear(ear, true)) {
        cancel_point();
        ear = next_[ear];
        ++looked_at;
        --looks;
      }
      if (looked_at == left_ || looks == 0) break;
      clip(ear);
    }
    ear = left_corner(ear);
    for (uint32_t b = next_[ear]; next_[b] != ear; b = next_[b]) emit(ear, b, next_[b]);
  }

 private:
  static constexpr uint32_t kCellsPerSideMax = 256;
  static constexpr uint64_t kStrictLooksPerCorner = 64;
  // Looks at cells and their corners, per distinct place. Polygons whose corners are all distinct
  // never need so many. One of 65,536 corners at four places took 1e9 looks and 3 s; its text is
  // 200 bytes in a zip.
  static constexpr int64_t kLooksPerPlace = limits::kPolygonCornersMax;
  static constexpr int64_t kLooksMin = int64_t{1} << 20;
  static constexpr uint32_t kNone = ~0u;

  // Moves a corner to the end of the queue, from any place in it.
  void enqueue(uint32_t corner) {
    queued_[corner] = static_cast<uint32_t>(queue_.size());
    queue_.push_back(corner);
  }
  // Clips the queue's ears. A clipped corner's neighbours go to the end of the queue, so a convex
  // polygon loses every second corner first and gives no sliver fan.
  void clip_queued() {
    for (uint32_t i = 0; i < queue_.size() && left_ > 3; ++i) {
      cancel_point();
      const uint32_t corner = queue_[i];
      if (queued_[corner] == i && !is_clipped(corner) && is_ear(corner, false)) clip(corner);
    }
    queue_.clear();
  }
  // `corner`, or the next one after it that is left.
  uint32_t left_corner(uint32_t corner) const {
    while (is_clipped(corner)) corner = corner + 1 == points_.size() ? 0 : corner + 1;
    return corner;
  }

  void make_cells() {
    min_ = max_ = points_[0];
    for (const glm::dvec2& p : points_) {
      min_ = glm::min(min_, p);
      max_ = glm::max(max_, p);
    }
    const double side = std::sqrt(static_cast<double>(points_.size()) / 4.0);
    cells_per_side_ = std::clamp(static_cast<uint32_t>(side), 1u, kCellsPerSideMax);
    cells_.resize(static_cast<size_t>(cells_per_side_) * cells_per_side_);
    for (uint32_t i = 0; i < points_.size(); ++i) {
      if (corner_turn(i) <= 0.0) {
        cells_[cell_index(cell_of(points_[i].x, 0), cell_of(points_[i].y, 1))].push_back(i);
      }
    }
  }

  uint32_t cell_of(double x, int axis) const {
    const double extent = max_[axis] - min_[axis];
    if (!(extent > 0.0)) return 0;
    const double cell = (x - min_[axis]) / extent * cells_per_side_;
    return std::min(static_cast<uint32_t>(std::max(cell, 0.0)), cells_per_side_ - 1);
  }
  size_t cell_index(uint32_t x, uint32_t y) const {
    return static_cast<size_t>(y) * cells_per_side_ + x;
  }
  double corner_turn(uint32_t b) const {
    return orient(points_[previous_[b]], points_[b], points_[next_[b]]);
  }

  bool is_ear(uint32_t b, bool strict) {
    const uint32_t a = previous_[b], c = next_[b];
    const double turn = corner_turn(b);
    // A corner on the line through its neighbours covers no area, so it may always be clipped.
    if (turn == 0.0) return true;
    if (!(turn > 0.0) || looks_left_ <= 0) return false;
    const glm::dvec2 low = glm::min(points_[a], glm::min(points_[b], points_[c]));
    const glm::dvec2 high = glm::max(points_[a], glm::max(points_[b], points_[c]));
    const uint32_t x_end = cell_of(high.x, 0), y_end = cell_of(high.y, 1);
    for (uint32_t y = cell_of(low.y, 1); y <= y_end; ++y) {
      for (uint32_t x = cell_of(low.x, 0); x <= x_end; ++x) {
        const uint32_t p = blocker_in(cells_[cell_index(x, y)], a, b, c, low, high, strict);
        if (--looks_left_ <= 0) return false;
        if (p == kNone) continue;
        if (!strict) blocked_by_[p].push_back(b);
        return false;
      }
    }
    return true;
  }

  // A corner of the cell that lies in the ear, or kNone. Corners that were clipped or became convex
  // are removed from the cell, because they never matter again.
  uint32_t blocker_in(std::vector<uint32_t>& cell, uint32_t a, uint32_t b, uint32_t c,
                      const glm::dvec2& low, const glm::dvec2& high, bool strict) {
    for (size_t i = 0; i < cell.size() && looks_left_-- > 0;) {
      const uint32_t p = cell[i];
      const glm::dvec2& point = points_[p];
      if (point.x < low.x || point.x > high.x || point.y < low.y || point.y > high.y) {
        ++i;
        continue;
      }
      if (is_clipped(p) || corner_turn(p) > 0.0) {
        cell[i] = cell.back();
        cell.pop_back();
        continue;
      }
      if (p != a && p != b && p != c && blocks(p, a, b, c, strict)) return p;
      ++i;
    }
    return kNone;
  }

  bool blocks(uint32_t p, uint32_t a, uint32_t b, uint32_t c, bool strict) const {
    const glm::dvec2 &pp = points_[p], &pa = points_[a], &pb = points_[b], &pc = points_[c];
    const double ab = orient(pa, pb, pp), bc = orient(pb, pc, pp), ca = orient(pc, pa, pp);
    if (strict) return ab > 0.0 && bc > 0.0 && ca > 0.0;
    // An edge that goes from a or c into the ear ends in it or crosses the opposite edge.
    if (pp == pa || pp == pc) return false;
    if (pp == pb) return in_cone(previous_[p], a, b, c) || in_cone(next_[p], a, b, c);
    return ab >= 0.0 && bc >= 0.0 && ca >= 0.0;
  }
  // Whether q, seen from b, is strictly between c and a.
  bool in_cone(uint32_t q, uint32_t a, uint32_t b, uint32_t c) const {
    return orient(points_[a], points_[b], points_[q]) > 0.0 &&
           orient(points_[b], points_[c], points_[q]) > 0.0;
  }

  static int64_t place_count(std::span<const glm::dvec2> points) {
    std::vector<glm::dvec2> places(points.begin(), points.end());
    const auto is_before = [](const glm::dvec2& a, const glm::dvec2& b) {
      return std::tie(a.x, a.y) < std::tie(b.x, b.y);
    };
    std::sort(places.begin(), places.end(), is_before);
    return std::unique(places.begin(), places.end()) - places.begin();
  }
  bool is_clipped(uint32_t p) const { return next_[p] == p; }
  void clip(uint32_t b) {
    const uint32_t a = previous_[b], c = next_[b];
    emit(a, b, c);
    next_[a] = c;
    previous_[c] = a;
    next_[b] = b;
    --left_;
    enqueue(a);
    enqueue(c);
    release(b, false);
    release(a, corner_turn(a) <= 0.0);
    release(c, corner_turn(c) <= 0.0);
  }
  // Queues the ears that `p` blocked. If p can still block, only those whose tip is at p's own
  // place are queued, because p's edges decide there.
  void release(uint32_t p, bool still_blocks) {
    looks_left_ -= std::ssize(blocked_by_[p]);
    if (looks_left_ <= 0) return;
    std::erase_if(blocked_by_[p], [&](uint32_t b) {
      if (still_blocks && points_[b] != points_[p]) return false;
      if (!is_clipped(b)) enqueue(b);
      return true;
    });
  }
  void emit(uint32_t a, uint32_t b, uint32_t c) {
    out_.push_back(a);
    out_.push_back(b);
    out_.push_back(c);
  }

  std::span<const glm::dvec2> points_;
  std::vector<uint32_t>& out_;
  uint32_t left_;  // corners not clipped
  int64_t looks_left_ = 0;
  std::vector<uint32_t> previous_, next_;          // the ring of corners that are left
  std::vector<uint32_t> queue_;                    // corners to examine; may hold outdated entries
  std::vector<uint32_t> queued_;                   // each corner's last place in the queue
  std::vector<std::vector<uint32_t>> blocked_by_;  // for each corner, the ears it was found to
                                                   // block
  std::vector<std::vector<uint32_t>> cells_;       // reflex and flat corners
  uint32_t cells_per_side_ = 1;
  glm::dvec2 min_{0.0}, max_{0.0};
};

void append_fan(size_t count, std::vector<uint32_t>& out) {
  for (uint32_t i = 2; i < count; ++i) {
    out.push_back(0);
    out.push_back(i - 1);
    out.push_back(i);
  }
}

// Splits along the diagonal 0-2, or along 1-3 if 0-2 would be outside a concave quadrilateral.
void append_quad(std::span<const glm::dvec3> corners, const glm::dvec3& normal,
                 std::vector<uint32_t>& out) {
  const auto turn = [&](size_t a, size_t b, size_t c) {
    return glm::dot(glm::cross(corners[b] - corners[a], corners[c] - corners[a]), normal);
  };
  if (turn(0, 1, 2) < 0.0 || turn(2, 3, 0) < 0.0) {
    out.insert(out.end(), {1, 2, 3, 1, 3, 0});
  } else {
    out.insert(out.end(), {0, 1, 2, 0, 2, 3});
  }
}

}  // namespace

void triangulate_polygon(std::span<const glm::dvec3> corners, std::vector<uint32_t>& out) {
  if (corners.size() < 3) return;
  if (corners.size() == 3) return append_fan(3, out);
  const glm::dvec3 normal = newell_normal(corners);
  if (corners.size() == 4) return append_quad(corners, normal, out);
  if (normal == glm::dvec3(0.0)) return append_fan(corners.size(), out);
  const std::vector<glm::dvec2> points = project(corners, normal);
  EarClipper(points, out).run();
}

}  // namespace voxeld
