#include "server/worker/mesh_topology.h"

#include <algorithm>
#include <array>
#include <bit>
#include <span>
#include <utility>
#include <vector>

#include "server/worker/mesh_components.h"

namespace voxeld {
namespace {

// Gives equal positions equal numbers: an open-addressing table of numbers into a list of
// positions.
class PositionNumbers {
 public:
  explicit PositionNumbers(size_t count_max)
      : slots_(std::bit_ceil(count_max * 2 + 2), kEmpty), mask_(slots_.size() - 1) {
    positions_.reserve(count_max);
  }

  uint32_t number_of(const glm::dvec3& p) {
    // + 0.0 turns -0.0 into 0.0: the same point with other bits.
    const Bits position = {std::bit_cast<uint64_t>(p.x + 0.0), std::bit_cast<uint64_t>(p.y + 0.0),
                           std::bit_cast<uint64_t>(p.z + 0.0)};
    size_t slot = hash_of(position) & mask_;
    while (slots_[slot] != kEmpty) {
      if (positions_[slots_[slot]] == position) return slots_[slot];
      slot = (slot + 1) & mask_;
    }
    slots_[slot] = static_cast<uint32_t>(positions_.size());
    positions_.push_back(position);
    return slots_[slot];
  }
  size_t size() const { return positions_.size(); }
  std::vector<glm::dvec3> positions() const {
    std::vector<glm::dvec3> points;
    points.reserve(positions_.size());
    for (const Bits& p : positions_) {
      points.emplace_back(std::bit_cast<double>(p[0]), std::bit_cast<double>(p[1]),
                          std::bit_cast<double>(p[2]));
    }
    return points;
  }

 private:
  using Bits = std::array<uint64_t, 3>;
  static constexpr uint32_t kEmpty = 0xffffffffu;

  // Finalizer of splitmix64 (Steele, Lea, Flood 2014) over the three bit patterns.
  static uint64_t hash_of(const Bits& position) {
    uint64_t hash = 0;
    for (const uint64_t coordinate : position) {
      hash += coordinate + 0x9e3779b97f4a7c15ull;
      hash = (hash ^ (hash >> 30)) * 0xbf58476d1ce4e5b9ull;
      hash = (hash ^ (hash >> 27)) * 0x94d049bb133111ebull;
      hash ^= hash >> 31;
    }
    return hash;
  }

  std::vector<uint32_t> slots_;
  size_t mask_;
  std::vector<Bits> positions_;
};

using Corners = std::array<uint32_t, 3>;

// The other end of an edge that hangs on its end with the lower number.
struct HalfEdge {
  uint32_t high;
  int32_t direction;  // 1: from the lower number to the higher
};

void count_edge(std::span<const HalfEdge> uses, MeshTopology& topology) {
  int64_t balance = 0;
  for (const HalfEdge& use : uses) balance += use.direction;
  if (balance != 0) ++topology.unbalanced_edges;
  if (uses.size() == 1) ++topology.open_edges;
  if (uses.size() > 2) ++topology.non_manifold_edges;
  if (uses.size() == 2 && balance != 0) ++topology.flipped_edges;
}

// Edges are sorted by their lower end in linear time; few hang on one.
void count_edges(const std::vector<Corners>& triangles, size_t position_count,
                 MeshTopology& topology) {
  const auto for_each_edge = [&](const auto& visit) {
    for (const Corners& v : triangles) {
      for (size_t i = 0; i < 3; ++i) {
        const uint32_t from = v[i], to = v[(i + 1) % 3];
        visit(std::min(from, to), std::max(from, to), from < to ? 1 : -1);
      }
    }
  };
  std::vector<size_t> first(position_count + 1);
  for_each_edge([&](uint32_t low, uint32_t, int) { ++first[low + 1]; });
  for (size_t i = 0; i < position_count; ++i) first[i + 1] += first[i];
  std::vector<HalfEdge> edges(3 * triangles.size());
  std::vector<size_t> place(first.begin(), first.end() - 1);
  for_each_edge([&](uint32_t low, uint32_t high, int direction) {
    edges[place[low]++] = {high, direction};
  });
  for (size_t low = 0; low < position_count; ++low) {
    const std::span<HalfEdge> here =
        std::span(edges).subspan(first[low], first[low + 1] - first[low]);
    std::ranges::sort(here, {}, &HalfEdge::high);
    for (size_t begin = 0; begin < here.size();) {
      size_t end = begin + 1;
      while (end < here.size() && here[end].high == here[begin].high) ++end;
      count_edge(here.subspan(begin, end - begin), topology);
      begin = end;
    }
  }
}

}  // namespace

std::optional<MeshTopology> mesh_topology(const Scene& scene) {
  const size_t triangle_count = scene.triangle_count();
  if (triangle_count > static_cast<size_t>(kTopologyTrianglesMax)) return std::nullopt;
  MeshTopology topology;
  PositionNumbers numbers(std::min(scene.vertex_count(), triangle_count * 3));
  std::vector<Corners> triangles;
  triangles.reserve(triangle_count);
  for (const MeshPart& part : scene.parts) {
    for (size_t corner = 0; corner + 2 < part.indices.size(); corner += 3) {
      Corners v{};
      for (size_t i = 0; i < 3; ++i) {
        v[i] = numbers.number_of(part.positions[part.indices[corner + i]]);
      }
      if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) {
        ++topology.degenerate_triangles;
      } else {
        triangles.push_back(v);
      }
    }
  }
  topology.distinct_positions = static_cast<int64_t>(numbers.size());
  count_edges(triangles, numbers.size(), topology);
  count_components(triangles, numbers.positions(), topology);
  return topology;
}

}  // namespace voxeld
