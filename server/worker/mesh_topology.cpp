#include "server/worker/mesh_topology.h"

#include <algorithm>
#include <array>
#include <bit>
#include <utility>
#include <vector>

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

// Undirected edge a < b as a << 33 | b << 1 | direction: equal edges sort next to each other.
// Numbers have 32 bits less the one that kTopologyTrianglesMax leaves unused.
uint64_t edge_key(uint32_t from, uint32_t to) {
  const uint64_t low = std::min(from, to), high = std::max(from, to);
  return low << 33 | high << 1 | (from < to ? 0u : 1u);
}

void count_edges(std::vector<uint64_t>& edges, MeshTopology& topology) {
  std::sort(edges.begin(), edges.end());
  for (size_t first = 0; first < edges.size();) {
    size_t last = first + 1;
    while (last < edges.size() && edges[last] >> 1 == edges[first] >> 1) ++last;
    const size_t uses = last - first;
    if (uses == 1) ++topology.open_edges;
    if (uses > 2) ++topology.non_manifold_edges;
    if (uses == 2 && edges[first] == edges[first + 1]) ++topology.flipped_edges;
    first = last;
  }
}

}  // namespace

std::optional<MeshTopology> mesh_topology(const Scene& scene) {
  const size_t triangle_count = scene.triangle_count();
  if (triangle_count > static_cast<size_t>(kTopologyTrianglesMax)) return std::nullopt;
  MeshTopology topology;
  PositionNumbers numbers(std::min(scene.vertex_count(), triangle_count * 3));
  std::vector<uint64_t> edges;
  edges.reserve(triangle_count * 3);
  for (const MeshPart& part : scene.parts) {
    for (size_t corner = 0; corner + 2 < part.indices.size(); corner += 3) {
      std::array<uint32_t, 3> v{};
      for (size_t i = 0; i < 3; ++i) {
        v[i] = numbers.number_of(part.positions[part.indices[corner + i]]);
      }
      if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) {
        ++topology.degenerate_triangles;
        continue;
      }
      edges.push_back(edge_key(v[0], v[1]));
      edges.push_back(edge_key(v[1], v[2]));
      edges.push_back(edge_key(v[2], v[0]));
    }
  }
  topology.distinct_positions = static_cast<int64_t>(numbers.size());
  count_edges(edges, topology);
  return topology;
}

}  // namespace voxeld
