#include "server/voxel/triangles/split.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <tuple>

namespace voxeld {
namespace {

bool is_long(const ClipCorner& a, const ClipCorner& b) {
  const glm::dvec3 d = glm::abs(a.p_grid - b.p_grid);
  return std::max({d.x, d.y, d.z}) > kEdgeCellsMax;
}

// The middle of an edge. Addition commutes exactly, so the order of a and b does not matter.
ClipCorner middle(const ClipCorner& a, const ClipCorner& b) {
  ClipCorner m;
  m.p_grid = (a.p_grid + b.p_grid) * 0.5;
  for (size_t i = 0; i < 3; ++i) m.weights[i] = (a.weights[i] + b.weights[i]) * 0.5;
  return m;
}

bool comes_first(const ClipCorner& a, const ClipCorner& b) {
  return std::tie(a.p_grid.x, a.p_grid.y, a.p_grid.z) <
         std::tie(b.p_grid.x, b.p_grid.y, b.p_grid.z);
}

// Triangle t with its corners rotated so that edge `edge`, from corner `edge` to the next, becomes
// edge 0.
SplitTriangle turned(const SplitTriangle& t, size_t edge) {
  return {t[edge], t[(edge + 1) % 3], t[(edge + 2) % 3]};
}

// Halves a triangle of which only edge 0 is long.
void halve(const SplitTriangle& t, std::vector<SplitTriangle>& out) {
  const ClipCorner m = middle(t[0], t[1]);
  out.push_back({t[0], m, t[2]});
  out.push_back({m, t[1], t[2]});
}

// Cuts a triangle of which edges 0 and 1 are long. The remaining quad can be cut in two ways; the
// ends of edge 2 decide which.
void cut_corner(const SplitTriangle& t, std::vector<SplitTriangle>& out) {
  const ClipCorner m0 = middle(t[0], t[1]), m1 = middle(t[1], t[2]);
  out.push_back({m0, t[1], m1});
  if (comes_first(t[0], t[2])) {
    out.push_back({t[0], m0, m1});
    out.push_back({t[0], m1, t[2]});
  } else {
    out.push_back({t[0], m0, t[2]});
    out.push_back({m0, m1, t[2]});
  }
}

void quarter(const SplitTriangle& t, std::vector<SplitTriangle>& out) {
  const ClipCorner m0 = middle(t[0], t[1]), m1 = middle(t[1], t[2]), m2 = middle(t[2], t[0]);
  out.push_back({t[0], m0, m2});
  out.push_back({m0, t[1], m1});
  out.push_back({m2, m1, t[2]});
  out.push_back({m0, m1, m2});
}

}  // namespace

void split_triangle(const SplitTriangle& triangle, std::vector<SplitTriangle>& out) {
  // A stack of open triangles. It empties because an edge can be halved only so often.
  std::vector<SplitTriangle> open = {triangle};
  while (!open.empty()) {
    const SplitTriangle t = open.back();
    open.pop_back();
    std::array<bool, 3> longs{};
    size_t count = 0;
    for (size_t e = 0; e < 3; ++e) {
      longs[e] = is_long(t[e], t[(e + 1) % 3]);
      count += longs[e] ? 1 : 0;
    }
    const auto edge = [&](bool wanted) {
      return static_cast<size_t>(std::ranges::find(longs, wanted) - longs.begin());
    };
    switch (count) {
      case 0:
        out.push_back(t);
        break;
      case 1:
        halve(turned(t, edge(true)), open);
        break;
      case 2:
        cut_corner(turned(t, (edge(false) + 1) % 3), open);
        break;
      default:
        quarter(t, open);
    }
  }
}

}  // namespace voxeld
