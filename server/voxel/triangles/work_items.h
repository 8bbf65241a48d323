// Splitting of a triangle's rectangle of columns into work items. Internal to tile_window.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "server/voxel/triangles/tile_window.h"

namespace voxeld {

// Items of one class and image are sorted into this many classes of cost, so that the lanes of a
// SIMD group have equal work.
inline constexpr size_t kItemCostBuckets = 32;

struct PendingItem {
  WorkItemWords words;
  uint32_t key = 0;  // (class * images + image run) * kItemCostBuckets + cost
};

// Output of one chunk of triangles.
struct ChunkItems {
  std::vector<PendingItem> items;
  uint64_t blocks = 0;  // TileWindow::blocks
};

class ItemMaker {
 public:
  ItemMaker(const glm::ivec3& cell_max, const ItemSizes& sizes, size_t image_runs)
      : cell_max_(cell_max), sizes_(sizes), image_runs_(image_runs) {}

  // Adds the items of a triangle; none if it surely touches no cell. q: corners in the tile's
  // coordinates.
  void add(const std::array<glm::ivec3, 3>& q, int axis, uint32_t triangle, size_t image_run,
           ChunkItems& out) const;

 private:
  struct Target;  // destination of one triangle's items
  // A rectangle of columns; both ends are inclusive.
  struct Rectangle {
    int i0, j0, i1, j1;
  };
  static void push(const Target& target, const Rectangle& columns);
  static uint64_t blocks_of(const Rectangle& columns, int k0, int k1, int axis);
  void add_large(const std::array<glm::ivec3, 3>& q, const Rectangle& all, int k0, int k1,
                 const Target& target) const;

  glm::ivec3 cell_max_;
  ItemSizes sizes_;
  size_t image_runs_;
};

}  // namespace voxeld
