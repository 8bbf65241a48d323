#include "server/render/hull.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <glm/common.hpp>
#include <limits>
#include <tuple>

#include "proto/limits.h"
#include "server/base/cancel_point.h"
#include "server/base/pieces.h"

namespace voxeld {
namespace {

constexpr int kRowsPerSideMax = 1024;

// The first and the one after the last occupied cube of a row along x.
struct Row {
  int begin = std::numeric_limits<int>::max(), end = std::numeric_limits<int>::min();
  bool is_empty() const { return begin >= end; }
};

// The rows of a grid, whose cells are joined to cubes of 2^shift a side.
class Rows {
 public:
  explicit Rows(const glm::ivec3& dims) {
    const int longest = std::max(dims.x, std::max(dims.y, dims.z));
    while ((longest + (1 << shift_) - 1) >> shift_ > kRowsPerSideMax) ++shift_;
    size_ = (dims + ((1 << shift_) - 1)) >> shift_;
    rows_.resize(static_cast<size_t>(size_.y) * static_cast<size_t>(size_.z));
  }

  // Adds the cells [low, high).
  void add(const glm::ivec3& low, const glm::ivec3& high) {
    const glm::ivec3 first = low >> shift_;
    const glm::ivec3 last = glm::min((high - 1) >> shift_, size_ - 1);
    for (int z = first.z; z <= last.z; ++z) {
      for (int y = first.y; y <= last.y; ++y) {
        Row& row = at(y, z);
        row.begin = std::min(row.begin, first.x);
        row.end = std::max(row.end, last.x + 1);
      }
    }
  }

  void add(const SparseTile& tile) {
    const glm::ivec3 base =
        glm::ivec3(tile.coord[0], tile.coord[1], tile.coord[2]) * limits::kTileSide;
    for (const FullNode& node : tile.full) {
      cancel_point();
      const glm::ivec3 low = base + first_cell(node.brick_morton);
      add(low, low + (limits::kBrickSide << node.level));
    }
    for (size_t i = 0; i < tile.masks.size(); ++i) {
      cancel_point();
      const glm::ivec3 low = base + first_cell(tile.brick_morton[i]);
      // A cube that holds the brick is the same for all of its cells.
      if ((1 << shift_) >= limits::kBrickSide) {
        add(low, low + limits::kBrickSide);
      } else {
        add(tile.masks[i], low);
      }
    }
  }

  // The corners of the cubes at the ends of the rows, without those inside the hull of their slice.
  std::vector<glm::ivec3> corners() const;
  int shift() const { return shift_; }

 private:
  static glm::ivec3 first_cell(uint32_t brick_morton) {
    const auto brick = morton_decode(brick_morton);
    return glm::ivec3(brick[0], brick[1], brick[2]) * limits::kBrickSide;
  }

  void add(const BrickMask& mask, const glm::ivec3& base) {
    for (uint32_t word = 0; word < mask.words.size(); ++word) {
      for (uint64_t bits = mask.words[word]; bits != 0; bits &= bits - 1) {
        const auto p = morton_decode(word * 64 + static_cast<uint32_t>(std::countr_zero(bits)));
        const glm::ivec3 cell = (base + glm::ivec3(p[0], p[1], p[2])) >> shift_;
        Row& row = at(cell.y, cell.z);
        row.begin = std::min(row.begin, cell.x);
        row.end = std::max(row.end, cell.x + 1);
      }
    }
  }

  Row& at(int y, int z) { return rows_[index(y, z)]; }
  const Row& at(int y, int z) const { return rows_[index(y, z)]; }
  size_t index(int y, int z) const {
    return static_cast<size_t>(y) + static_cast<size_t>(size_.y) * static_cast<size_t>(z);
  }

  int shift_ = 0;
  glm::ivec3 size_;  // in cubes
  std::vector<Row> rows_;
};

struct Point {
  int64_t along, across;
};

// One side of the convex hull of points in ascending `along`: Andrew's monotone chain ("Another
// efficient algorithm for convex hulls in two dimensions", 1979). sign 1: the side of small
// `across`; -1: of large.
class Chain {
 public:
  explicit Chain(int64_t sign) : sign_(sign) {}

  void add(const Point& p) {
    while (points_.size() >= 2) {
      const Point &a = points_[points_.size() - 2], &b = points_.back();
      const int64_t turn =
          (b.along - a.along) * (p.across - a.across) - (b.across - a.across) * (p.along - a.along);
      if (sign_ * turn > 0) break;
      points_.pop_back();
    }
    points_.push_back(p);
  }
  const std::vector<Point>& points() const { return points_; }

 private:
  int64_t sign_;
  std::vector<Point> points_;
};

std::vector<glm::ivec3> Rows::corners() const {
  std::vector<glm::ivec3> corners;
  for (int z = 0; z < size_.z; ++z) {
    Chain low(1), high(-1);
    for (int y = 0; y < size_.y; ++y) {
      const Row& row = at(y, z);
      if (row.is_empty()) continue;
      for (const int edge : {y, y + 1}) {
        low.add({edge, row.begin});
        high.add({edge, row.end});
      }
    }
    for (const Chain* chain : {&low, &high}) {
      for (const Point& p : chain->points()) {
        for (const int side : {z, z + 1}) corners.emplace_back(p.across, p.along, side);
      }
    }
  }
  return corners;
}

// By one coordinate after the other, and each point once.
void sort_by(std::vector<glm::ivec3>& points, int first, int second, int third) {
  cancellable_sort(points.begin(), points.end(), [&](const glm::ivec3& a, const glm::ivec3& b) {
    return std::tuple(a[first], a[second], a[third]) < std::tuple(b[first], b[second], b[third]);
  });
  points.erase(std::unique(points.begin(), points.end()), points.end());
}

// Removes the points that are not on the hull of those in the same plane across axis `plane`.
std::vector<glm::ivec3> reduced(std::vector<glm::ivec3> points, int plane, int along, int across) {
  sort_by(points, plane, along, across);
  std::vector<glm::ivec3> left;
  for (size_t begin = 0, end = 0; begin < points.size(); begin = end) {
    Chain low(1), high(-1);
    for (; end < points.size() && points[end][plane] == points[begin][plane]; ++end) {
      const Point p{points[end][along], points[end][across]};
      low.add(p);
      high.add(p);
    }
    for (const Chain* chain : {&low, &high}) {
      for (const Point& p : chain->points()) {
        glm::ivec3 point;
        point[plane] = points[begin][plane];
        point[along] = static_cast<int>(p.along);
        point[across] = static_cast<int>(p.across);
        left.push_back(point);
      }
    }
  }
  return left;
}

}  // namespace

std::vector<glm::ivec3> hull_points(const Grid& grid) {
  Rows rows(grid.spec.dims);
  for (const SparseTile& tile : grid.tiles) rows.add(tile);
  std::vector<glm::ivec3> points = reduced(reduced(rows.corners(), 1, 2, 0), 0, 1, 2);
  for (glm::ivec3& p : points) p = glm::min(p << rows.shift(), grid.spec.dims);
  sort_by(points, 2, 1, 0);
  return points;
}

}  // namespace voxeld
