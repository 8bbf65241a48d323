#include "server/worker/mesh_components.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

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
      root_[find(v[0])] = find(v[1]);
      root_[find(v[1])] = find(v[2]);
    }
    sort(triangles);
    for (Component& component : list_) measure(component);
  }

  const std::vector<Component>& list() const { return list_; }

  // Generalized winding number of the component (Jacobson et al. 2013), by the solid angles of van
  // Oosterom & Strackee 1983.
  double winding_number(const Component& component, const glm::dvec3& p) const {
    double sum = 0;
    for (const Corners& v : of(component)) {
      const glm::dvec3 a = positions_[v[0]] - p, b = positions_[v[1]] - p, c = positions_[v[2]] - p;
      const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c);
      sum +=
          std::atan2(glm::dot(a, glm::cross(b, c)), la * lb * lc + glm::dot(a, b) * lc +
                                                        glm::dot(b, c) * la + glm::dot(c, a) * lb);
    }
    return sum / (2 * std::numbers::pi);
  }

 private:
  uint32_t find(uint32_t a) {
    while (root_[a] != a) a = root_[a] = root_[root_[a]];
    return a;
  }

  std::span<const Corners> of(const Component& component) const {
    return std::span(sorted_).subspan(component.first, component.count);
  }

  // Components are numbered as they come in the file.
  void sort(std::span<const Corners> triangles) {
    constexpr uint32_t kNone = UINT32_MAX;
    std::vector<uint32_t> number(root_.size(), kNone);
    for (const Corners& v : triangles) {
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
    for (const Corners& v : triangles) sorted_[place[number[find(v[0])]]++] = v;
  }

  void measure(Component& component) {
    for (const Corners& v : of(component)) {
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

  // Every directed edge has its opposite: by sums of hashes, which cancel out. (A sum of 64 bits
  // that is 0 by chance does not happen.)
  static bool is_closed(std::span<const Corners> triangles) {
    uint64_t sum = 0;
    for (const Corners& v : triangles) {
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
  const Components components(triangles, positions);
  const std::vector<Component>& list = components.list();
  topology.components = static_cast<int64_t>(list.size());
  int64_t enclosed = 0, walls = 0, pairs = 0, angles = 0;
  for (const Component& inner : list) {
    bool is_enclosed = false, is_wall = false;
    for (const Component& outer : list) {
      if (++pairs > kEnclosureAnglesMax) return;
      if (!outer.closed || !lies_within(inner, outer)) continue;
      angles += static_cast<int64_t>(outer.count);
      if (angles > kEnclosureAnglesMax) return;
      if (std::abs(components.winding_number(outer, inner.vertex)) <= 0.5) continue;
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
