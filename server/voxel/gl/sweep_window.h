// What one dispatch of solid_crossings.comp, or one draw of the slice map, needs: triangles of a
// sweep in the tile's coordinates, and work items.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/voxel/solid/crossings.h"
#include "server/voxel/tile_window.h"

namespace voxeld {

// The part of a tile that crossings are looked for in, in cells of the grid.
struct SweepTarget {
  int axis = 2;
  ColumnWindow window;
  int tile_first = 0;      // along w: of the tile
  int cell_first = 0;      // along w: of the slab, which may be the tile
  int cell_end = 0;        // beyond the slab's last cell that is inside the grid
  int block_columns = 16;  // ItemSizes
};

struct SweepWindow {
  std::vector<int32_t> corners;      // 9 per triangle: u v w of three corners, q from the tile's
  std::vector<WorkItemWords> items;  // columns as in shaders/shared/voxelize.h, axis unused
  // Of triangles with a corner kSweepQMax or further from the tile's min corner, where 64 bits do
  // not hold what the passes compute: found here, by 128 bits. Cells count from the tile.
  std::vector<Crossing> given;

  size_t triangle_count() const { return corners.size() / 9; }
};

// Corners nearer than this give crossings in 64 bits: lib/crossings.glsl.
inline constexpr int kSweepQMax = (1 << 19) + (1 << 10);
// 2.25 MiB of corners, 4 MiB of items; given crossings may be 2^16 more.
inline constexpr size_t kSweepTrianglesMax = size_t{1} << 16;
inline constexpr size_t kSweepItemsMax = size_t{1} << 19;
inline constexpr size_t kSweepGivenMax = size_t{1} << 18;

// Fills `window` from triangles [first, …) of the list as far as it takes them; returns the first
// that is left. Items are sorted by size, so that the lanes of a group do alike.
size_t fill_sweep_window(const FillMesh& mesh, std::span<const uint32_t> triangles, size_t first,
                         const SweepTarget& target, SweepWindow& window);

}  // namespace voxeld
