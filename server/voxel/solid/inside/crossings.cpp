#include "server/voxel/solid/inside/crossings.h"

#include <algorithm>
#include <cstdlib>
#include <type_traits>
#include <utility>

#include "server/base/cancel_point.h"

namespace voxeld {
namespace {

__extension__ using Wide = __int128;
__extension__ using UnsignedWide = unsigned __int128;

// Corners below this need only 64 bits. Coordinates take 21 bits with the sign. The normal, twice
// an area in a square of 2^21, takes 43; times a depth that is 64. Intermediate sums may wrap; the
// results fit.
constexpr int kNarrowQMax = (1 << 19) + (1 << 10);

using Corners = std::array<std::array<int64_t, 3>, 3>;  // u, v, w

// Tests one triangle against a rectangle of columns, in units of half a sub-voxel. Corners are at
// odd numbers, centres of cells at even ones.
template <typename Int>
class ColumnRaster {
 public:
  // False if the triangle is edge-on: it crosses no column.
  bool set_up(const Corners& p, int sub_voxel_bits) {
    Corners v = p;
    const auto wrapped = [](int64_t x) { return static_cast<Unsigned>(static_cast<Int>(x)); };
    const auto normal = [&](size_t i, size_t j) {
      return static_cast<Int>(wrapped(v[1][i] - v[0][i]) * wrapped(v[2][j] - v[0][j]) -
                              wrapped(v[1][j] - v[0][j]) * wrapped(v[2][i] - v[0][i]));
    };
    if (normal(0, 1) == 0) return false;
    faces_down_ = normal(0, 1) < 0;
    if (faces_down_) std::swap(v[1], v[2]);
    origin_ = v[0];
    normal_u_ = normal(1, 2);
    normal_v_ = normal(2, 0);
    normal_w_ = normal(0, 1);
    half_cell_ = int64_t{1} << sub_voxel_bits;
    depth_unit_ = normal_w_ * static_cast<Int>(2 * half_cell_);
    for (size_t i = 0; i < 3; ++i) {
      const auto& from = v[i];
      const auto& to = v[(i + 1) % 3];
      a_[i] = static_cast<Int>(from[1] - to[1]);
      b_[i] = static_cast<Int>(to[0] - from[0]);
      // A point exactly on a side is inside if the side's interior lies to its right, or above a
      // level side. Neighbours that share the side then count the point once.
      const bool inclusive = a_[i] > 0 || (a_[i] == 0 && b_[i] > 0);
      c_[i] = -a_[i] * static_cast<Int>(from[0]) - b_[i] * static_cast<Int>(from[1]) -
              (inclusive ? 0 : 1);
    }
    return true;
  }

  bool faces_down() const { return faces_down_; }
  int64_t centre(int cell) const { return cell * (2 * half_cell_) + half_cell_; }

  // Calls visit(u, first cell) for the cells u_first to u_last of row v that lie inside the
  // projection.
  template <typename Visit>
  void row(int u_first, int u_last, int v, const Visit& visit) const {
    const auto pu = static_cast<Int>(centre(u_first)), pv = static_cast<Int>(centre(v));
    std::array<Int, 3> e, step;
    for (size_t i = 0; i < 3; ++i) {
      e[i] = a_[i] * pu + b_[i] * pv + c_[i];
      step[i] = a_[i] * static_cast<Int>(2 * half_cell_);
    }
    for (int u = u_first; u <= u_last; ++u) {
      if ((e[0] | e[1] | e[2]) >= 0) visit(u, first_cell(u, v));
      for (size_t i = 0; i < 3; ++i) e[i] += step[i];
    }
  }

 private:
  using Unsigned = std::conditional_t<sizeof(Int) == 8, uint64_t, UnsignedWide>;

  // The least k with k + 1/2 >= the plane's depth.
  int64_t first_cell(int u, int v) const {
    const auto up = [](int64_t x) { return static_cast<Unsigned>(static_cast<Int>(x)); };
    const auto numerator =
        static_cast<Int>(up(origin_[2] - half_cell_) * static_cast<Unsigned>(normal_w_) -
                         static_cast<Unsigned>(normal_u_) * up(centre(u) - origin_[0]) -
                         static_cast<Unsigned>(normal_v_) * up(centre(v) - origin_[1]));
    // The quotient is small, so the double is off by less than one before truncation. The remainder
    // then corrects k to the integer above.
    auto k =
        static_cast<int64_t>(static_cast<double>(numerator) / static_cast<double>(depth_unit_));
    Int remainder = numerator - static_cast<Int>(k) * depth_unit_;
    for (; remainder > 0; remainder -= depth_unit_) ++k;
    for (; remainder <= -depth_unit_; remainder += depth_unit_) --k;
    return k;
  }

  bool faces_down_ = false;
  std::array<int64_t, 3> origin_{};
  Int normal_u_ = 0, normal_v_ = 0, normal_w_ = 0, depth_unit_ = 0;
  int64_t half_cell_ = 0;
  std::array<Int, 3> a_{}, b_{}, c_{};
};

struct Rectangle {
  CentreRange u, v;
};

template <typename Int>
void append(const Corners& p, int sub_voxel_bits, const Rectangle& cells,
            const ColumnWindow& window, int cells_w, std::vector<Crossing>& out) {
  ColumnRaster<Int> raster;
  if (!raster.set_up(p, sub_voxel_bits)) return;
  for (int v = cells.v.first; v <= cells.v.last; ++v) {
    const auto row = static_cast<uint32_t>(v - window.v_first) << 8;
    raster.row(cells.u.first, cells.u.last, v, [&](int u, int64_t first_cell) {
      if (first_cell >= cells_w) return;
      out.push_back(make_crossing(row | static_cast<uint32_t>(u - window.u_first),
                                  static_cast<int>(std::max<int64_t>(first_cell, 0)),
                                  raster.faces_down()));
    });
  }
}

}  // namespace

void append_crossings(const FillMesh& mesh, std::span<const uint32_t> triangles, int axis,
                      const ColumnWindow& window, int cells_w, std::vector<Crossing>& out) {
  const SweepAxes axes = sweep_axes(axis);
  const int bits = mesh.sub_voxel_bits();
  for (const uint32_t t : triangles) {
    cancel_point();
    const std::array<glm::ivec3, 3> q = mesh.corners(t);
    const glm::ivec3 low = glm::min(q[0], glm::min(q[1], q[2]));
    const glm::ivec3 high = glm::max(q[0], glm::max(q[1], q[2]));
    Rectangle cells = {centre_range(low[axes.u], high[axes.u], bits),
                       centre_range(low[axes.v], high[axes.v], bits)};
    cells.u.first = std::max(cells.u.first, window.u_first);
    cells.v.first = std::max(cells.v.first, window.v_first);
    cells.u.last = std::min(cells.u.last, window.u_first + window.u_count - 1);
    cells.v.last = std::min(cells.v.last, window.v_first + window.v_count - 1);
    if (cells.u.first > cells.u.last || cells.v.first > cells.v.last) continue;
    Corners p;
    for (size_t i = 0; i < 3; ++i) {
      p[i] = {2 * int64_t{q[i][axes.u]} + 1, 2 * int64_t{q[i][axes.v]} + 1,
              2 * int64_t{q[i][axes.w]} + 1};
    }
    const bool narrow = low.x > -kNarrowQMax && low.y > -kNarrowQMax && low.z > -kNarrowQMax &&
                        high.x < kNarrowQMax && high.y < kNarrowQMax && high.z < kNarrowQMax;
    if (narrow) {
      append<int64_t>(p, bits, cells, window, cells_w, out);
    } else {
      append<Wide>(p, bits, cells, window, cells_w, out);
    }
  }
}

}  // namespace voxeld
