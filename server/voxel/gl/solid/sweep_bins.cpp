#include "server/voxel/gl/solid/sweep_bins.h"

#include <algorithm>
#include <array>

#include "server/base/cancel_point.h"

namespace voxeld {
namespace {

int parts_of(int cells, int part) {
  return (cells + part - 1) / part;
}

// Parts from first to last, inclusive; none if first > last.
struct PartRange {
  int first = 1, last = 0;
};

PartRange column_range(int q_min, int q_max, int bits, int cells) {
  const CentreRange range = centre_range(q_min, q_max, bits);
  const int first = std::max(range.first, 0), last = std::min(range.last, cells - 1);
  if (first > last) return {};
  return {first / limits::kTileSide, last / limits::kTileSide};
}

// The slabs of the first cells whose centre is not below a depth in the range.
PartRange slab_range(int q_min, int q_max, int bits, int cells, int slab_cells) {
  const CentreRange range = centre_range(q_min, q_max, bits);
  const int first = std::max(range.first, 0), last = std::clamp(range.last + 1, 0, cells - 1);
  if (first > last) return {};
  return {first / slab_cells, last / slab_cells};
}

}  // namespace

// Counting sort by bin.
SweepBins::SweepBins(const FillMesh& mesh, int axis, const glm::ivec3& dims, int slab_cells)
    : axis_(axis),
      tiles_u_(parts_of(dims[sweep_axes(axis).u], limits::kTileSide)),
      slabs_(parts_of(dims[axis], slab_cells)) {
  const SweepAxes axes = sweep_axes(axis);
  const int tiles_v = parts_of(dims[axes.v], limits::kTileSide);
  first_.resize(bin_of(0, tiles_v, 0) + 1);
  const auto for_each_bin = [&](size_t t, const auto& visit) {
    const auto q = mesh.corners(t);
    const auto bounds = [&](int along) {
      return std::minmax({q[0][along], q[1][along], q[2][along]});
    };
    const int bits = mesh.sub_voxel_bits();
    const auto [u_min, u_max] = bounds(axes.u);
    const PartRange u = column_range(u_min, u_max, bits, dims[axes.u]);
    if (u.first > u.last) return;
    const auto [v_min, v_max] = bounds(axes.v);
    const PartRange v = column_range(v_min, v_max, bits, dims[axes.v]);
    const auto [w_min, w_max] = bounds(axes.w);
    const PartRange w = slab_range(w_min, w_max, bits, dims[axes.w], slab_cells);
    for (int tile_v = v.first; tile_v <= v.last; ++tile_v) {
      for (int tile_u = u.first; tile_u <= u.last; ++tile_u) {
        for (int slab = w.first; slab <= w.last; ++slab) visit(bin_of(tile_u, tile_v, slab));
      }
    }
  };
  const size_t triangles = mesh.triangle_count();
  for (size_t t = 0; t < triangles; ++t) {
    cancel_point();
    for_each_bin(t, [&](size_t bin) { ++first_[bin + 1]; });
  }
  for (size_t bin = 1; bin < first_.size(); ++bin) first_[bin] += first_[bin - 1];
  list_.resize(first_.back());
  std::vector<size_t> place(first_.begin(), first_.end() - 1);
  for (size_t t = 0; t < triangles; ++t) {
    cancel_point();
    for_each_bin(t, [&](size_t bin) { list_[place[bin]++] = static_cast<uint32_t>(t); });
  }
}

}  // namespace voxeld
