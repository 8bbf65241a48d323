// The input of one dispatch of solid_crossings.comp, or one draw of the slice map: triangles of a
// sweep in the tile's coordinates, and work items.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/voxel/solid/inside/crossings.h"
#include "server/voxel/triangles/tile_window.h"

namespace voxeld {

// The part of a tile in which crossings are sought, in cells of the grid.
struct SweepTarget {
  int axis = 2;
  ColumnWindow window;
  int tile_first = 0;      // first cell of the tile along w
  int cell_first = 0;      // first cell of the slab, which may be the whole tile, along w
  int cell_end = 0;        // one past the slab's last cell inside the grid
  int block_columns = 16;  // ItemSizes
};

struct SweepWindow {
  std::vector<int32_t> corners;      // 9 per triangle: u v w of three corners, q from the tile's
  std::vector<WorkItemWords> items;  // columns as in shaders/shared/voxelize.h, axis unused
  // Crossings that the CPU finds in 128 bits. They belong to triangles with a corner at least
  // kSweepQMax away from the tile's min corner, for which the passes' 64 bits do not suffice. Cells
  // count from the tile.
  std::vector<Crossing> given;

  size_t triangle_count() const { return corners.size() / 9; }
};

// Corners nearer than this give crossings in 64 bits; see lib/crossings.glsl.
inline constexpr int kSweepQMax = (1 << 19) + (1 << 10);
// Limits of a window: 2.25 MiB of corners, 4 MiB of items. Given crossings may exceed theirs by
// 2^16.
inline constexpr size_t kSweepTrianglesMax = size_t{1} << 16;
inline constexpr size_t kSweepItemsMax = size_t{1} << 19;
inline constexpr size_t kSweepGivenMax = size_t{1} << 18;

// Fills `window` from triangles [first, …) of the list until it is full. Returns the first triangle
// that is left. Items are sorted by size, so that the lanes of a group have equal work.
size_t fill_sweep_window(const FillMesh& mesh, std::span<const uint32_t> triangles, size_t first,
                         const SweepTarget& target, SweepWindow& window);

}  // namespace voxeld
