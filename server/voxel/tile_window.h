// What one dispatch needs: the triangles of a part of a tile's list, in the tile's coordinates, and
// work items small enough that no invocation comes near the loop limit of software drivers.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/voxel/bin.h"
#include "server/voxel/snap.h"

namespace voxeld {

// Which program variant runs an item; see shaders/lib/touch.glsl.
enum class TouchClass : uint8_t {
  kRows,   // small, and the bounding box is a row of cells: all touched, nothing to test
  kSmall,  // at most 15 voxels wide (4 with small items): 32-bit plane test, one item
  kLarge,  // 64-bit plane test
};
inline constexpr size_t kTouchClassCount = 3;

// Work items of one class and one image, consecutive in TileWindow::items.
struct ItemRange {
  TouchClass touch_class = TouchClass::kRows;
  int image = -1;
  size_t first = 0, count = 0;
};

// Layout of an item: VOXELIZE_ITEM_… in shaders/shared/voxelize.h.
struct WorkItemWords {
  uint32_t triangle = 0;
  uint32_t columns = 0;
};

struct TileWindow {
  std::vector<int32_t> vertices;     // 9 per triangle: three corners in ascending order
  std::vector<uint8_t> axes;         // per triangle: dominant axis
  std::vector<WorkItemWords> items;  // by class, then image, then cost
  std::vector<ItemRange> ranges;     // non-empty ones, in the order of items
  // Runs of triangles of one image, for the raster pipeline.
  struct ImageRun {
    int image = -1;
    size_t first = 0, count = 0;
  };
  std::vector<ImageRun> image_runs;
  // Blocks of 64^3 cells that may be touched: bit = Morton index of the block in the tile.
  uint64_t blocks = 0;

  size_t triangle_count() const { return axes.size(); }
};

// Columns to a side of a work item. Large ones share the set-up of a triangle, small ones give
// devices with thousands of lanes enough to do; 1..16.
struct ItemSizes {
  int block_columns = 16;
};

// Triangles of one window: 19 MB of vertices and 52 MB of attributes stay far below the 128 MiB
// that storage buffers have on software drivers, and one window serves most tiles.
inline constexpr size_t kWindowTrianglesMax = size_t{1} << 19;
// Work items of a window; a window with more is made of fewer triangles. 16 MiB.
inline constexpr size_t kWindowItemsMax = size_t{1} << 21;

// Fills `window` from `triangles` (a part of a bin). `part_images`: part_image() of every part.
// False when there are more than kWindowItemsMax items: `window` is then of no use. One triangle
// never has as many.
bool fill_tile_window(const SnappedMesh& mesh, const GridSpec& spec, const glm::ivec3& tile_coord,
                      std::span<const uint32_t> triangles, std::span<const int> part_images,
                      const ItemSizes& sizes, TileWindow& window);

// Last cell of the tile that is inside the grid, on each axis.
glm::ivec3 tile_cell_max(const GridSpec& spec, const glm::ivec3& tile_coord);

// Corner numbers 0..2 in ascending order of position (x, then y, then z), and whether that order
// has turned the triangle's orientation. Attributes are computed in this order, so that a file's
// order of corners does not change a byte.
struct CornerOrder {
  std::array<uint8_t, 3> corner{0, 1, 2};
  bool reversed = false;
};
CornerOrder corner_order(const std::array<glm::ivec3, 3>& q);

// Dominant axis of the integer normal; z before x before y where several are largest. A triangle
// without area takes the axis in which it is shortest, in the same order.
int dominant_axis(const std::array<glm::ivec3, 3>& q);

}  // namespace voxeld
