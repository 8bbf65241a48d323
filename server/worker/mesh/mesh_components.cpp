#include "server/worker/mesh/mesh_components.h"

#include <algorithm>
#include <numeric>

#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include "server/base/cancel_point.h"

namespace voxeld {
namespace {

using Corners = std::array<uint32_t, 3>;

struct Component {
  size_t first = 0, count = 0;  // triangles, in the order by component
  glm::dvec3 min{1e308}, max{-1e308};
  glm::dvec3 vertex{0.0};  // of the triangle that comes first
  double volume = 0;       // with the sign of its orientation
  bool closed = false;
};

class Components {
 public:
  Components(std::span<const Corners> triangles, const std::vector<glm::dvec3>& positions)
      : positions_(positions), root_(positions.size()) {
    std::iota(root_.begin(), root_.end(), 0u);
    for (const Corners& v : triangles) {
      cancel_point();
      join(v[0], v[1]);
      join(v[1], v[2]);
    }
    std::vector<uint8_t> used(positions.size());
    for (const Corners& v : triangles) {
      cancel_point();
      for (const uint32_t vertex : v) used[vertex] = 1;
    }
    count_ = static_cast<int64_t>(std::ranges::count(used, uint8_t{1})) - joins_;
  }

  int64_t count() const { return count_; }

  // The components one by one, in the order of the file.
  const std::vector<Component>& list(std::span<const Corners> triangles) {
    sort(triangles);
    for (Component& component : list_) {
      cancel_point();
      measure(component);
    }
    return list_;
  }

  // The winding number of the closed component around p: the sum of signs of its triangles on the
  // ray from p towards +x. The side of an edge in (y, z) is computed alike for both of its
  // triangles.
  int64_t winding_number(const Component& component, const glm::dvec3& p) const {
    int64_t sum = 0;
    for (const Corners& v : of(component)) {
      cancel_point();
      const double y0 = positions_[v[0]].y, y1 = positions_[v[1]].y, y2 = positions_[v[2]].y;
      if (std::min({y0, y1, y2}) > p.y || std::max({y0, y1, y2}) <= p.y) continue;
      sum += crossing(v, p);
    }
    return sum;
  }

 private:
  // +1 or -1, by direction, if the triangle's edge passes p in (y, z) on the side towards +z.
  int edge_around(uint32_t from, uint32_t to, const glm::dvec3& p) const {
    const bool from_above = positions_[from].y > p.y, to_above = positions_[to].y > p.y;
    if (from_above == to_above) return 0;
    // Always from below to above, so both triangles of the edge compute the same value.
    const glm::dvec3& low = positions_[from_above ? to : from];
    const glm::dvec3& high = positions_[from_above ? from : to];
    const double side = (high.y - low.y) * (p.z - low.z) - (high.z - low.z) * (p.y - low.y);
    if (side >= 0) return 0;
    return from_above ? -1 : 1;
  }

  int crossing(const Corners& v, const glm::dvec3& p) const {
    const int around =
        edge_around(v[0], v[1], p) + edge_around(v[1], v[2], p) + edge_around(v[2], v[0], p);
    if (around == 0) return 0;
    const glm::dvec3 a = positions_[v[0]] - p, b = positions_[v[1]] - p, c = positions_[v[2]] - p;
    const double volume = glm::dot(a, glm::cross(b, c));
    // `around` is positive if the normal's x is negative. The plane is on the +x side of p if the
    // volume has the sign of the normal's x.
    return volume * around < 0 ? around : 0;
  }

  uint32_t find(uint32_t a) {
    while (root_[a] != a) a = root_[a] = root_[root_[a]];
    return a;
  }

  void join(uint32_t a, uint32_t b) {
    a = find(a);
    b = find(b);
    if (a == b) return;
    root_[std::max(a, b)] = std::min(a, b);
    ++joins_;
  }

  std::span<const Corners> of(const Component& component) const {
    return std::span(sorted_).subspan(component.first, component.count);
  }

  void sort(std::span<const Corners> triangles) {
    constexpr uint32_t kNone = UINT32_MAX;
    std::vector<uint32_t> number(root_.size(), kNone);
    for (const Corners& v : triangles) {
      cancel_point();
      uint32_t& one = number[find(v[0])];
      if (one == kNone) {
        one = static_cast<uint32_t>(list_.size());
        list_.emplace_back().vertex = positions_[v[0]];
      }
      ++list_[one].count;
    }
    size_t total = 0;
    for (Component& component : list_) {
      component.first = total;
      total += component.count;
    }
    sorted_.resize(total);
    std::vector<size_t> place;
    place.reserve(list_.size());
    for (const Component& component : list_) place.push_back(component.first);
    for (const Corners& v : triangles) {
      cancel_point();
      sorted_[place[number[find(v[0])]]++] = v;
    }
  }

  void measure(Component& component) {
    for (const Corners& v : of(component)) {
      cancel_point();
      const glm::dvec3 a = positions_[v[0]] - component.vertex;
      component.volume += glm::dot(
          a, glm::cross(positions_[v[1]] - component.vertex, positions_[v[2]] - component.vertex));
      for (size_t i = 0; i < 3; ++i) {
        component.min = glm::min(component.min, positions_[v[i]]);
        component.max = glm::max(component.max, positions_[v[i]]);
      }
    }
    component.closed = is_closed(of(component));
  }

  // Whether every directed edge has its opposite: hashes of both cancel out in a sum. A chance sum
  // of 0 in 64 bits is negligible.
  static bool is_closed(std::span<const Corners> triangles) {
    uint64_t sum = 0;
    for (const Corners& v : triangles) {
      cancel_point();
      for (size_t i = 0; i < 3; ++i) {
        const uint32_t from = v[i], to = v[(i + 1) % 3];
        uint64_t hash = uint64_t{std::min(from, to)} << 32 | std::max(from, to);
        hash = (hash ^ (hash >> 30)) * 0xbf58476d1ce4e5b9ull;
        hash = (hash ^ (hash >> 27)) * 0x94d049bb133111ebull;
        hash ^= hash >> 31;
        sum += from < to ? hash : ~hash + 1;
      }
    }
    return sum == 0;
  }

  const std::vector<glm::dvec3>& positions_;
  std::vector<uint32_t> root_;
  int64_t joins_ = 0, count_ = 0;
  std::vector<Corners> sorted_;
  std::vector<Component> list_;
};

bool lies_within(const Component& inner, const Component& outer) {
  return glm::all(glm::greaterThan(inner.min, outer.min)) &&
         glm::all(glm::lessThan(inner.max, outer.max));
}

}  // namespace

void count_components(std::span<const Corners> triangles, const std::vector<glm::dvec3>& positions,
                      MeshTopology& topology) {
  Components components(triangles, positions);
  topology.components = components.count();
  if (topology.components < 2) {
    topology.enclosed_components = topology.inner_walls = 0;
    return;
  }
  const std::vector<Component>& list = components.list(triangles);
  int64_t enclosed = 0, walls = 0, pairs = 0, tests = 0;
  for (const Component& inner : list) {
    bool is_enclosed = false, is_wall = false;
    for (const Component& outer : list) {
      cancel_point();
      if (++pairs > kEnclosureTestsMax) return;
      if (!outer.closed || !lies_within(inner, outer)) continue;
      tests += static_cast<int64_t>(outer.count);
      if (tests > kEnclosureTestsMax) return;
      if (components.winding_number(outer, inner.vertex) == 0) continue;
      is_enclosed = true;
      is_wall = is_wall || (inner.closed && (inner.volume > 0) == (outer.volume > 0));
    }
    enclosed += is_enclosed ? 1 : 0;
    walls += is_wall ? 1 : 0;
  }
  topology.enclosed_components = enclosed;
  topology.inner_walls = walls;
}

}  // namespace voxeld
