#include "server/voxel/bin.h"

#include <algorithm>
#include <bit>
#include <numeric>

#include "proto/limits.h"
#include "proto/sparse_tile.h"
#include "server/voxel/parallel.h"

namespace voxeld {
namespace {

constexpr size_t kTriangleGrain = 1 << 15;

// First and last tile of a triangle's box on each axis, 10 bits each, x first in the lowest.
uint64_t tile_span(const SnappedMesh& mesh, const SnappedTriangle& triangle,
                   const glm::ivec3& tile_dims) {
  constexpr int kTileShift = limits::kSubVoxelBits + std::countr_zero(unsigned{limits::kTileSide});
  const glm::ivec3 &a = mesh.vertices[triangle.vertices[0]],
                   &b = mesh.vertices[triangle.vertices[1]],
                   &c = mesh.vertices[triangle.vertices[2]];
  uint64_t span = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const int low = std::min({a[axis], b[axis], c[axis]}) >> kTileShift;
    const int high = std::max({a[axis], b[axis], c[axis]}) >> kTileShift;
    span |= static_cast<uint64_t>(std::max(low, 0)) << (10 * axis);
    span |= static_cast<uint64_t>(std::min(high, tile_dims[axis] - 1)) << (10 * axis + 30);
  }
  return span;
}

template <typename Visit>
void for_each_tile(uint64_t span, const glm::ivec3& tile_dims, const Visit& visit) {
  const auto at = [&](int shift) { return static_cast<uint32_t>(span >> shift & 1023u); };
  for (uint32_t z = at(20); z <= at(50); ++z) {
    for (uint32_t y = at(10); y <= at(40); ++y) {
      const uint32_t row =
          (z * static_cast<uint32_t>(tile_dims.y) + y) * static_cast<uint32_t>(tile_dims.x);
      for (uint32_t x = at(0); x <= at(30); ++x) visit(row + x);
    }
  }
}

}  // namespace

// A counting sort: counts per tile and chunk, offsets, then every chunk writes its own places.
TileBins::TileBins(const SnappedMesh& mesh, const glm::ivec3& tile_dims) {
  const auto tile_count = static_cast<size_t>(tile_dims.x) * static_cast<size_t>(tile_dims.y) *
                          static_cast<size_t>(tile_dims.z);
  const size_t count = mesh.triangles.size();
  if (tile_count == 1) {
    triangles_.resize(count);
    std::iota(triangles_.begin(), triangles_.end(), 0u);
    if (count > 0) bins_.push_back({glm::ivec3(0), triangles_});
    return;
  }
  std::vector<std::vector<size_t>> places(chunk_count(count, kTriangleGrain),
                                          std::vector<size_t>(tile_count));
  std::vector<uint64_t> spans(count);
  parallel_chunks(count, kTriangleGrain, [&](size_t chunk, size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      spans[t] = tile_span(mesh, mesh.triangles[t], tile_dims);
      for_each_tile(spans[t], tile_dims, [&](uint32_t tile) { ++places[chunk][tile]; });
    }
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
  parallel_chunks(count, kTriangleGrain, [&](size_t chunk, size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      for_each_tile(spans[t], tile_dims, [&](uint32_t tile) {
        triangles_[places[chunk][tile]++] = static_cast<uint32_t>(t);
      });
    }
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
