#include "server/voxel/solid/inside/triangle_columns.h"

#include <algorithm>
#include <array>

#include "server/base/parallel.h"

namespace voxeld {
namespace {

constexpr size_t kTriangleGrain = 1 << 14;

int tiles_of(int cells) {
  return (cells + limits::kTileSide - 1) / limits::kTileSide;
}

// Tiles from first to last, inclusive; none if first > last.
CentreRange tile_range(int q_min, int q_max, int bits, int cells) {
  CentreRange range = centre_range(q_min, q_max, bits);
  range.first = std::max(range.first, 0);
  range.last = std::min(range.last, cells - 1);
  if (range.first > range.last) return {1, 0};
  return {range.first / limits::kTileSide, range.last / limits::kTileSide};
}

}  // namespace

// A counting sort: counts per chunk and column, then offsets, then every chunk writes its own
// range.
TriangleColumns::TriangleColumns(const FillMesh& mesh, int axis, const glm::ivec3& dims)
    : axis_(axis),
      dims_(dims),
      tiles_u_(tiles_of(dims[sweep_axes(axis).u])),
      tiles_v_(tiles_of(dims[sweep_axes(axis).v])),
      first_(count() + 1) {
  const SweepAxes axes = sweep_axes(axis);
  const size_t triangles = mesh.triangle_count();
  if (count() == 1) {  // all triangles, without a test
    list_.resize(triangles);
    for (size_t t = 0; t < triangles; ++t) {
      cancel_point();
      list_[t] = static_cast<uint32_t>(t);
    }
    first_.back() = triangles;
    return;
  }
  const auto for_each_column = [&](size_t t, const auto& visit) {
    const auto q = mesh.corners(t);
    const auto range = [&](int along) {
      const int low = std::min(q[0][along], std::min(q[1][along], q[2][along]));
      const int high = std::max(q[0][along], std::max(q[1][along], q[2][along]));
      return tile_range(low, high, mesh.sub_voxel_bits(), dims[along]);
    };
    const CentreRange u = range(axes.u);
    if (u.first > u.last) return;
    const CentreRange v = range(axes.v);
    for (int row = v.first; row <= v.last; ++row) {
      for (int column = u.first; column <= u.last; ++column) {
        visit(static_cast<size_t>(row) * static_cast<size_t>(tiles_u_) +
              static_cast<size_t>(column));
      }
    }
  };
  std::vector<std::vector<size_t>> places(chunk_count(triangles, kTriangleGrain),
                                          std::vector<size_t>(count()));
  parallel_chunks(triangles, kTriangleGrain, [&](size_t chunk, size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      cancel_point();
      for_each_column(t, [&](size_t column) { ++places[chunk][column]; });
    }
  });
  size_t total = 0;
  for (size_t column = 0; column < count(); ++column) {
    first_[column] = total;
    for (auto& chunk : places) {
      const size_t in_chunk = chunk[column];
      chunk[column] = total;
      total += in_chunk;
    }
  }
  first_[count()] = total;
  list_.resize(total);
  parallel_chunks(triangles, kTriangleGrain, [&](size_t chunk, size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      cancel_point();
      for_each_column(
          t, [&](size_t column) { list_[places[chunk][column]++] = static_cast<uint32_t>(t); });
    }
  });
}

ColumnWindow TriangleColumns::window(size_t column) const {
  const SweepAxes axes = sweep_axes(axis_);
  const int u = static_cast<int>(column) % tiles_u_ * limits::kTileSide;
  const int v = static_cast<int>(column) / tiles_u_ * limits::kTileSide;
  return {u, v, std::min(limits::kTileSide, dims_[axes.u] - u),
          std::min(limits::kTileSide, dims_[axes.v] - v)};
}

}  // namespace voxeld
