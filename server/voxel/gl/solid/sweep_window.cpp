#include "server/voxel/gl/solid/sweep_window.h"

#include <algorithm>
#include <array>
#include <bit>

#include <glm/common.hpp>

#include "shaders/shared/voxelize.h"

namespace voxeld {
namespace {

constexpr size_t kBlocksMax = 256;  // items of one triangle, with 16 columns a side
constexpr int kItemColumnsMax = VOXELIZE_BLOCK_COLUMNS;
// Classes of items by number of columns, which doubles from class to class.
constexpr size_t kClasses = 9;

// Columns in the tile; both ends are inclusive.
struct Columns {
  int u0, v0, u1, v1;
  bool empty() const { return u0 > u1 || v0 > v1; }
  int count() const { return (u1 - u0 + 1) * (v1 - v0 + 1); }
};

Columns columns_of(const std::array<glm::ivec3, 3>& q, const SweepAxes& axes, int bits,
                   const ColumnWindow& window) {
  const auto range = [&](int along, int first, int count) {
    const auto [low, high] = std::minmax({q[0][along], q[1][along], q[2][along]});
    const CentreRange cells = centre_range(low, high, bits);
    return CentreRange{std::max(cells.first - first, 0), std::min(cells.last - first, count - 1)};
  };
  const CentreRange u = range(axes.u, window.u_first, window.u_count);
  const CentreRange v = range(axes.v, window.v_first, window.v_count);
  return {u.first, v.first, u.last, v.last};
}

class WindowFiller {
 public:
  WindowFiller(const FillMesh& mesh, const SweepTarget& target, SweepWindow& window)
      : mesh_(mesh), target_(target), axes_(sweep_axes(target.axis)), window_(window) {
    window_.corners.clear();
    window_.items.clear();
    window_.given.clear();
  }

  bool is_full() const {
    return window_.triangle_count() >= kSweepTrianglesMax ||
           item_count_ + kBlocksMax * 16 > kSweepItemsMax || window_.given.size() >= kSweepGivenMax;
  }

  void add(uint32_t triangle) {
    const std::array<glm::ivec3, 3> q = mesh_.corners(triangle);
    const Columns columns = columns_of(q, axes_, mesh_.sub_voxel_bits(), target_.window);
    if (columns.empty()) return;
    glm::ivec3 base;
    base[axes_.u] = target_.window.u_first;
    base[axes_.v] = target_.window.v_first;
    base[axes_.w] = target_.tile_first;
    base *= 1 << mesh_.sub_voxel_bits();
    std::array<glm::ivec3, 3> p = {q[0] - base, q[1] - base, q[2] - base};
    const glm::ivec3 reach = glm::max(glm::abs(p[0]), glm::max(glm::abs(p[1]), glm::abs(p[2])));
    if (std::max({reach.x, reach.y, reach.z}) >= kSweepQMax) {
      give(triangle);
      return;
    }
    const auto index = static_cast<uint32_t>(window_.triangle_count());
    for (const glm::ivec3& corner : p) {
      window_.corners.insert(window_.corners.end(),
                             {corner[axes_.u], corner[axes_.v], corner[axes_.w]});
    }
    add_items(index, columns);
  }

  void finish() {
    for (const auto& items : by_class_) {
      window_.items.insert(window_.items.end(), items.begin(), items.end());
    }
  }

 private:
  void add_items(uint32_t triangle, const Columns& all) {
    const int step = std::min(target_.block_columns, kItemColumnsMax);
    for (int v = all.v0; v <= all.v1; v += step) {
      for (int u = all.u0; u <= all.u1; u += step) {
        const Columns part = {u, v, std::min(u + step - 1, all.u1), std::min(v + step - 1, all.v1)};
        const auto words = static_cast<uint32_t>(part.u0) |
                           static_cast<uint32_t>(part.v0) << VOXELIZE_ITEM_J_SHIFT |
                           static_cast<uint32_t>(part.u1 - part.u0) << VOXELIZE_ITEM_NI_SHIFT |
                           static_cast<uint32_t>(part.v1 - part.v0) << VOXELIZE_ITEM_NJ_SHIFT;
        const int size = std::bit_width(static_cast<unsigned>(part.count())) - 1;
        by_class_[static_cast<size_t>(size)].push_back({triangle, words});
        ++item_count_;
      }
    }
  }

  // Finds the crossings of a triangle that is too large for the passes' 64 bits.
  void give(uint32_t triangle) {
    found_.clear();
    append_crossings(mesh_, std::span(&triangle, 1), target_.axis, target_.window, target_.cell_end,
                     found_);
    for (const Crossing c : found_) {
      const int cell = crossing_cell(c);
      if (cell < target_.cell_first) continue;
      window_.given.push_back(
          make_crossing(crossing_column(c), cell - target_.tile_first, crossing_winding(c) > 0));
    }
  }

  const FillMesh& mesh_;
  const SweepTarget& target_;
  const SweepAxes axes_;
  SweepWindow& window_;
  std::array<std::vector<WorkItemWords>, kClasses> by_class_;
  size_t item_count_ = 0;
  std::vector<Crossing> found_;
};

}  // namespace

size_t fill_sweep_window(const FillMesh& mesh, std::span<const uint32_t> triangles, size_t first,
                         const SweepTarget& target, SweepWindow& window) {
  WindowFiller filler(mesh, target, window);
  size_t next = first;
  while (next < triangles.size() && !filler.is_full()) filler.add(triangles[next++]);
  filler.finish();
  return next;
}

}  // namespace voxeld
