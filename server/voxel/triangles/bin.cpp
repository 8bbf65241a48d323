#include "server/voxel/triangles/bin.h"

#include <algorithm>
#include <bit>

#include "proto/codec/sparse_tile.h"
#include "proto/limits.h"
#include "server/base/parallel.h"
#include "server/base/pieces.h"
#include "server/base/raw_vector.h"

namespace voxeld {
namespace {

constexpr size_t kBinGrain = 1 << 15;
constexpr int kTileShift = limits::kSubVoxelBits + std::countr_zero(unsigned{limits::kTileSide});

// The tiles that a triangle's box reaches, both ends included.
struct TileSpan {
  glm::ivec3 first, last;
};

TileSpan tile_span(const SnappedMesh& mesh, const SnappedTriangle& triangle,
                   const glm::ivec3& tile_dims) {
  const glm::ivec3 &a = mesh.vertices[triangle.vertices[0]],
                   &b = mesh.vertices[triangle.vertices[1]],
                   &c = mesh.vertices[triangle.vertices[2]];
  TileSpan span;
  for (int axis = 0; axis < 3; ++axis) {
    const int low = std::min(a[axis], std::min(b[axis], c[axis])) >> kTileShift;
    const int high = std::max(a[axis], std::max(b[axis], c[axis])) >> kTileShift;
    span.first[axis] = std::max(low, 0);
    span.last[axis] = std::min(high, tile_dims[axis] - 1);
  }
  return span;
}

uint32_t tile_number(const glm::ivec3& tile, const glm::ivec3& tile_dims) {
  return static_cast<uint32_t>((tile.z * tile_dims.y + tile.y) * tile_dims.x + tile.x);
}

// The tile of each vertex, or the nearest tile if the vertex is outside all.
RawVector<uint32_t> tiles_of_vertices(const SnappedMesh& mesh, const glm::ivec3& tile_dims) {
  RawVector<uint32_t> tiles(mesh.vertices.size());
  const glm::ivec3 last = tile_dims - 1;
  parallel_chunks(tiles.size(), kBinGrain, [&](size_t, size_t begin, size_t end) {
    for (size_t v = begin; v < end; ++v) {
      cancel_point_at(v);
      const glm::ivec3& q = mesh.vertices[v];
      tiles[v] = tile_number(
          {std::clamp(q.x >> kTileShift, 0, last.x), std::clamp(q.y >> kTileShift, 0, last.y),
           std::clamp(q.z >> kTileShift, 0, last.z)},
          tile_dims);
    }
  });
  return tiles;
}

template <typename Visit>
void for_each_tile(const TileSpan& span, const glm::ivec3& tile_dims, const Visit& visit) {
  glm::ivec3 tile;
  for (tile.z = span.first.z; tile.z <= span.last.z; ++tile.z) {
    for (tile.y = span.first.y; tile.y <= span.last.y; ++tile.y) {
      for (tile.x = span.first.x; tile.x <= span.last.x; ++tile.x) {
        visit(tile_number(tile, tile_dims));
      }
    }
  }
}

}  // namespace

// A counting sort: counts per tile and chunk, then offsets, then every chunk writes its own range.
// Most triangles reach a single tile, the one that holds all their vertices.
TileBins::TileBins(const SnappedMesh& mesh, const glm::ivec3& tile_dims) {
  const auto tile_count = static_cast<size_t>(tile_dims.x) * static_cast<size_t>(tile_dims.y) *
                          static_cast<size_t>(tile_dims.z);
  const size_t count = mesh.triangles.size();
  if (tile_count == 1) {
    triangles_.resize(count);
    for (uint32_t t = 0; t < count; ++t) {
      cancel_point_at(t);
      triangles_[t] = t;
    }
    if (count > 0) bins_.push_back({glm::ivec3(0), triangles_});
    return;
  }
  std::vector<std::vector<size_t>> places(chunk_count(count, kBinGrain),
                                          std::vector<size_t>(tile_count));
  const RawVector<uint32_t> of_vertices = tiles_of_vertices(mesh, tile_dims);
  // Calls visit(triangle, tile) for a chunk's triangles.
  const auto for_each_pair = [&](size_t begin, size_t end, const auto& visit) {
    const uint32_t* tiles = of_vertices.data();
    for (size_t t = begin; t < end; ++t) {
      cancel_point_at(t);
      const SnappedTriangle& triangle = mesh.triangles[t];
      const uint32_t tile = tiles[triangle.vertices[0]];
      if (tile == tiles[triangle.vertices[1]] && tile == tiles[triangle.vertices[2]]) {
        visit(t, tile);
      } else {
        cancel_point();
        for_each_tile(tile_span(mesh, triangle, tile_dims), tile_dims,
                      [&](uint32_t one) { visit(t, one); });
      }
    }
  };
  parallel_chunks(count, kBinGrain, [&](size_t chunk, size_t begin, size_t end) {
    size_t* counts = places[chunk].data();
    for_each_pair(begin, end, [&](size_t, uint32_t tile) { ++counts[tile]; });
  });
  std::vector<size_t> first(tile_count + 1);
  size_t total = 0;
  for (size_t tile = 0; tile < tile_count; ++tile) {
    first[tile] = total;
    for (auto& chunk : places) {
      const size_t in_chunk = chunk[tile];
      chunk[tile] = total;
      total += in_chunk;
    }
  }
  first[tile_count] = total;
  triangles_.resize(total);
  parallel_chunks(count, kBinGrain, [&](size_t chunk, size_t begin, size_t end) {
    size_t* next = places[chunk].data();
    uint32_t* triangles = triangles_.data();
    for_each_pair(begin, end, [&](size_t t, uint32_t tile) {
      triangles[next[tile]++] = static_cast<uint32_t>(t);
    });
  });
  for (size_t tile = 0; tile < tile_count; ++tile) {
    if (first[tile] == first[tile + 1]) continue;
    const auto index = static_cast<int>(tile);
    bins_.push_back({glm::ivec3(index % tile_dims.x, index / tile_dims.x % tile_dims.y,
                                index / tile_dims.x / tile_dims.y),
                     std::span(triangles_).subspan(first[tile], first[tile + 1] - first[tile])});
  }
  std::sort(bins_.begin(), bins_.end(), [](const TileBin& a, const TileBin& b) {
    const auto code = [](const glm::ivec3& c) {
      return morton_encode(static_cast<uint32_t>(c.x), static_cast<uint32_t>(c.y),
                           static_cast<uint32_t>(c.z));
    };
    return code(a.coord) < code(b.coord);
  });
}

}  // namespace voxeld
