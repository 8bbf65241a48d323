#include "server/voxel/triangles/work_items.h"

#include <algorithm>
#include <cmath>

#include "proto/codec/sparse_tile.h"
#include "shaders/shared/voxelize.h"

namespace voxeld {
namespace {

// Extent of small triangles, in 1/256 voxel. A small triangle is one item, with at most as many
// columns as a large item, or 5 a side. It stays below TOUCH_SMALL_EXTENT of
// shaders/lib/touch.glsl, which 32 bits hold.
constexpr int kSmallExtentMin = 1024;
int small_extent(const ItemSizes& sizes) {
  return std::max(kSmallExtentMin, (sizes.block_columns - 1) * kSubVoxelsPerVoxel);
}
// Columns along a side of an item whose columns may be as deep as the tile (triangles without
// area). 8 * 8 * 257 iterations stay below the 65,535 that software drivers run.
constexpr int kDeepBlockColumns = 8;
constexpr int kBlockShift = 6;  // blocks of 64 cells, TileWindow::blocks

// 512 times the largest of n * (x - vertex) over the cell that begins at 0; see touch_reach().
int64_t reach(int64_t n, int q) {
  const int64_t f = q & 255;
  return n >= 0 ? n * (511 - 2 * f) : -n * (2 * f + 1);
}

// Edge functions of the projection and the plane, as in shaders/lib/touch.glsl, over blocks of
// columns. It is conservative: the shader tests each column again.
class BlockTest {
 public:
  BlockTest(const std::array<glm::ivec3, 3>& q, int axis) {
    const int x = (axis + 1) % 3, y = (axis + 2) % 3, z = axis;
    const glm::ivec3 d0 = q[1] - q[0], d1 = q[2] - q[1];
    normal_ = {int64_t{d0[y]} * d1[z] - int64_t{d0[z]} * d1[y],
               int64_t{d0[z]} * d1[x] - int64_t{d0[x]} * d1[z],
               int64_t{d0[x]} * d1[y] - int64_t{d0[y]} * d1[x]};
    const int64_t side = normal_[2] >= 0 ? 1 : -1;
    for (size_t i = 0; i < 3; ++i) {
      const glm::ivec3 d = q[(i + 1) % 3] - q[i];
      const int64_t a = -d[y] * side, b = d[x] * side;
      edges_[i] = {
          a, b,
          ((reach(a, q[i][x]) + reach(b, q[i][y])) >> 9) - a * (q[i][x] >> 8) - b * (q[i][y] >> 8)};
    }
    for (int64_t& n : normal_) n *= side;
    for (size_t c = 0; c < 3; ++c) {
      const int at = q[0][c == 0 ? x : c == 1 ? y : z];
      above_ += reach(normal_[c], at);
      below_ += reach(-normal_[c], at);
      plane_ -= normal_[c] * (at >> 8);
    }
    above_ >>= 9;
    below_ >>= 9;
  }

  bool has_area() const { return normal_[2] != 0; }

  // False if no column of [i0, i1] x [j0, j1] meets the projection, or the plane misses the cells
  // [k0, k1]. Otherwise narrows k0 and k1.
  bool may_touch(int i0, int j0, int i1, int j1, int& k0, int& k1) const {
    for (const Edge& e : edges_) {
      if (e.a * (e.a > 0 ? i1 : i0) + e.b * (e.b > 0 ? j1 : j0) + e.c < 0) return false;
    }
    if (!has_area()) return true;
    const int64_t most =
        normal_[0] * (normal_[0] > 0 ? i1 : i0) + normal_[1] * (normal_[1] > 0 ? j1 : j0) + plane_;
    const int64_t least =
        normal_[0] * (normal_[0] > 0 ? i0 : i1) + normal_[1] * (normal_[1] > 0 ? j0 : j1) + plane_;
    const double nz = static_cast<double>(normal_[2]);
    k0 = std::max(k0, static_cast<int>(std::floor(-static_cast<double>(most + above_) / nz)));
    k1 = std::min(k1, static_cast<int>(std::ceil(static_cast<double>(below_ - least) / nz)));
    return k0 <= k1;
  }

 private:
  struct Edge {
    int64_t a = 0, b = 0, c = 0;
  };
  std::array<Edge, 3> edges_{};
  std::array<int64_t, 3> normal_{};
  int64_t above_ = 0, below_ = 0, plane_ = 0;
};

}  // namespace

struct ItemMaker::Target {
  int axis;
  uint32_t triangle;
  size_t key;
  ChunkItems* out;
};

void ItemMaker::push(const Target& target, const Rectangle& r) {
  const int columns = (r.i1 - r.i0 + 1) * (r.j1 - r.j0 + 1);
  // Cost buckets: one for each count up to 16 columns, then one per 16.
  const int cost = columns <= 16 ? columns - 1 : 14 + (columns + 15) / 16;
  const int words = r.i0 | r.j0 << VOXELIZE_ITEM_J_SHIFT | (r.i1 - r.i0) << VOXELIZE_ITEM_NI_SHIFT |
                    (r.j1 - r.j0) << VOXELIZE_ITEM_NJ_SHIFT |
                    target.axis << VOXELIZE_ITEM_AXIS_SHIFT;
  target.out->items.push_back({{target.triangle, static_cast<uint32_t>(words)},
                               static_cast<uint32_t>(target.key + static_cast<size_t>(cost))});
}

uint64_t ItemMaker::blocks_of(const Rectangle& columns, int k0, int k1, int axis) {
  uint64_t blocks = 0;
  for (int k = k0 >> kBlockShift; k <= k1 >> kBlockShift; ++k) {
    for (int j = columns.j0 >> kBlockShift; j <= columns.j1 >> kBlockShift; ++j) {
      for (int i = columns.i0 >> kBlockShift; i <= columns.i1 >> kBlockShift; ++i) {
        glm::ivec3 block;
        block[axis] = k;
        block[(axis + 1) % 3] = i;
        block[(axis + 2) % 3] = j;
        blocks |= uint64_t{1} << morton_encode(static_cast<uint32_t>(block.x),
                                               static_cast<uint32_t>(block.y),
                                               static_cast<uint32_t>(block.z));
      }
    }
  }
  return blocks;
}

void ItemMaker::add(const std::array<glm::ivec3, 3>& q, int axis, uint32_t triangle,
                    size_t image_run, ChunkItems& out) const {
  const glm::ivec3 low = glm::min(q[0], glm::min(q[1], q[2]));
  const glm::ivec3 high = glm::max(q[0], glm::max(q[1], q[2]));
  const glm::ivec3 first = glm::max(low >> 8, glm::ivec3(0));
  const glm::ivec3 last = glm::min(high >> 8, cell_max_);
  if (first.x > last.x || first.y > last.y || first.z > last.z) return;
  const int x = (axis + 1) % 3, y = (axis + 2) % 3;
  const Rectangle all = {first[x], first[y], last[x], last[y]};
  const glm::ivec3 cells = (high >> 8) - (low >> 8);
  const glm::ivec3 extent = high - low;
  auto touch_class = TouchClass::kLarge;
  if (std::max({extent.x, extent.y, extent.z}) <= small_extent(sizes_)) {
    const bool is_row = (cells.x != 0) + (cells.y != 0) + (cells.z != 0) <= 1;
    touch_class = is_row ? TouchClass::kRows : TouchClass::kSmall;
  }
  const size_t group = static_cast<size_t>(touch_class) * image_runs_ + image_run;
  const Target target = {axis, triangle, group * kItemCostBuckets, &out};
  if (touch_class == TouchClass::kLarge) return add_large(q, all, first[axis], last[axis], target);
  out.blocks |= blocks_of(all, first[axis], last[axis], axis);
  push(target, all);
}

void ItemMaker::add_large(const std::array<glm::ivec3, 3>& q, const Rectangle& all, int k0, int k1,
                          const Target& target) const {
  const BlockTest test(q, target.axis);
  const int side =
      test.has_area() ? sizes_.block_columns : std::min(sizes_.block_columns, kDeepBlockColumns);
  for (int j = all.j0; j <= all.j1; j += side) {
    for (int i = all.i0; i <= all.i1; i += side) {
      const Rectangle block = {i, j, std::min(i + side - 1, all.i1),
                               std::min(j + side - 1, all.j1)};
      int block_k0 = k0, block_k1 = k1;
      if (!test.may_touch(block.i0, block.j0, block.i1, block.j1, block_k0, block_k1)) continue;
      target.out->blocks |= blocks_of(block, block_k0, block_k1, target.axis);
      push(target, block);
    }
  }
}

}  // namespace voxeld
