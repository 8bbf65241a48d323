#include "server/voxel/bin.h"

#include <algorithm>
#include <numeric>

#include "proto/sparse_tile.h"
#include "server/voxel/parallel.h"

namespace voxeld {
namespace {

constexpr size_t kTriangleGrain = 1 << 15;

template <typename Visit>
void for_each_tile(uint32_t tiles, const glm::ivec3& tile_dims, const Visit& visit) {
  const TileSpan span = TileSpan::unpack(tiles);
  for (uint32_t z = span.first[2]; z <= span.last[2]; ++z) {
    for (uint32_t y = span.first[1]; y <= span.last[1]; ++y) {
      const uint32_t row =
          (z * static_cast<uint32_t>(tile_dims.y) + y) * static_cast<uint32_t>(tile_dims.x);
      for (uint32_t x = span.first[0]; x <= span.last[0]; ++x) visit(row + x);
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
  parallel_chunks(count, kTriangleGrain, [&](size_t chunk, size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      for_each_tile(mesh.triangles[t].tiles, tile_dims,
                    [&](uint32_t tile) { ++places[chunk][tile]; });
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
      for_each_tile(mesh.triangles[t].tiles, tile_dims, [&](uint32_t tile) {
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
