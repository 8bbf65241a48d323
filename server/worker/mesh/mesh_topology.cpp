#include "server/worker/mesh/mesh_topology.h"

#include <algorithm>
#include <array>
#include <span>
#include <vector>

#include "server/base/cancel_point.h"
#include "server/base/in_pieces.h"
#include "server/base/parallel.h"
#include "server/base/raw_vector.h"
#include "server/worker/mesh/mesh_components.h"
#include "server/worker/mesh/position_numbers.h"

namespace voxeld {
namespace {

using Corners = std::array<uint32_t, 3>;

constexpr size_t kPositionGrain = size_t{1} << 17;  // positions per thread

// An edge, stored at its end with the lower number: twice the number of the other end, plus 1 if
// the triangle runs from the higher to the lower.
using HalfEdge = uint32_t;

template <typename Visit>
void for_each_edge(std::span<const Corners> triangles, const Visit& visit) {
  for (const Corners& v : triangles) {
    cancel_point();
    for (size_t i = 0; i < 3; ++i) {
      const uint32_t from = v[i], to = v[i == 2 ? 0 : i + 1];
      visit(std::min(from, to), 2 * std::max(from, to) + (from > to ? 1u : 0u));
    }
  }
}

// Sorts by insertion if there are few, because few edges meet at a position.
void sort_edges(std::span<HalfEdge> edges) {
  constexpr size_t kFew = 32;
  if (edges.size() > kFew) {
    std::ranges::sort(edges);
    return;
  }
  for (size_t i = 1; i < edges.size(); ++i) {
    const HalfEdge edge = edges[i];
    size_t at = i;
    for (; at > 0 && edges[at - 1] > edge; --at) edges[at] = edges[at - 1];
    edges[at] = edge;
  }
}

// Sorts and counts the edges stored at one position.
void count_edges_here(std::span<HalfEdge> edges, MeshTopology& topology) {
  sort_edges(edges);
  for (size_t begin = 0; begin < edges.size();) {
    size_t end = begin;
    int64_t balance = 0;
    for (; end < edges.size() && edges[end] / 2 == edges[begin] / 2; ++end) {
      balance += (edges[end] & 1) == 0 ? 1 : -1;
    }
    const size_t uses = end - begin;
    topology.unbalanced_edges += balance != 0 ? 1 : 0;
    topology.open_edges += uses == 1 ? 1 : 0;
    topology.non_manifold_edges += uses > 2 ? 1 : 0;
    topology.flipped_edges += uses == 2 && balance != 0 ? 1 : 0;
    begin = end;
  }
}

// Counts all edges. They are sorted by their lower end in linear time.
void count_edges(std::span<const Corners> triangles, size_t position_count,
                 MeshTopology& topology) {
  // first[i + 1]: where the next edge of position i is written; afterwards, where its edges end.
  std::vector<uint32_t> first;
  resize_in_pieces(first, position_count + 2);
  for_each_edge(triangles, [&](uint32_t low, HalfEdge) { ++first[low + 2]; });
  for (size_t i = 2; i < first.size(); ++i) {
    if (i % kCancelSteps == 0) cancel_point();
    first[i] += first[i - 1];
  }
  RawVector<HalfEdge> edges(3 * triangles.size());
  for_each_edge(triangles, [&](uint32_t low, HalfEdge edge) { edges[first[low + 1]++] = edge; });
  std::vector<MeshTopology> counts(chunk_count(position_count, kPositionGrain));
  parallel_chunks(position_count, kPositionGrain, [&](size_t chunk, size_t begin, size_t end) {
    MeshTopology count;
    for (size_t low = begin; low < end; ++low) {
      cancel_point();
      count_edges_here(std::span(edges).subspan(first[low], first[low + 1] - first[low]), count);
    }
    counts[chunk] = count;
  });
  for (const MeshTopology& count : counts) {
    topology.unbalanced_edges += count.unbalanced_edges;
    topology.open_edges += count.open_edges;
    topology.non_manifold_edges += count.non_manifold_edges;
    topology.flipped_edges += count.flipped_edges;
  }
}

// 0 for each vertex that a triangle uses, else kNone.
void mark_used(const MeshPart& part, std::vector<uint32_t>& used) {
  used.clear();
  resize_in_pieces(used, part.positions.size(), PositionNumbers::kNone);
  for (size_t i = 0; i < part.indices.size(); ++i) {
    if (i % kCancelSteps == 0) cancel_point();
    used[part.indices[i]] = 0;
  }
}

// Triangles as position numbers. Those that name a position twice are only counted.
std::vector<Corners> number_corners(const Scene& scene, PositionNumbers& numbers,
                                    MeshTopology& topology) {
  std::vector<Corners> triangles;
  triangles.reserve(scene.triangle_count());
  std::vector<uint32_t> of_vertex;
  for (const MeshPart& part : scene.parts) {
    mark_used(part, of_vertex);
    numbers.number(part.positions, of_vertex);
    for (size_t corner = 0; corner + 2 < part.indices.size(); corner += 3) {
      cancel_point();
      Corners v{};
      for (size_t i = 0; i < 3; ++i) v[i] = of_vertex[part.indices[corner + i]];
      if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) {
        ++topology.degenerate_triangles;
      } else {
        triangles.push_back(v);
      }
    }
  }
  return triangles;
}

}  // namespace

int64_t distinct_positions(const MeshPart& part) {
  PositionNumbers numbers(std::min(part.positions.size(), part.indices.size()));
  std::vector<uint32_t> used;
  mark_used(part, used);
  numbers.number(part.positions, used);
  return static_cast<int64_t>(numbers.size());
}

std::optional<MeshTopology> mesh_topology(const Scene& scene) {
  const size_t triangle_count = scene.triangle_count();
  if (triangle_count > static_cast<size_t>(kTopologyTrianglesMax)) return std::nullopt;
  MeshTopology topology;
  PositionNumbers numbers(std::min(scene.vertex_count(), triangle_count * 3));
  const std::vector<Corners> triangles = number_corners(scene, numbers, topology);
  topology.distinct_positions = static_cast<int64_t>(numbers.size());
  count_edges(triangles, numbers.size(), topology);
  count_components(triangles, numbers.positions(), topology);
  return topology;
}

}  // namespace voxeld
