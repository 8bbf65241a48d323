// The input of one dispatch: a part of a tile's triangles, in the tile's coordinates, and their
// work items. Items are small, so that no invocation gets near the loop limit of software drivers.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/voxel/triangles/bin.h"
#include "server/voxel/triangles/snap.h"

namespace voxeld {

// The program variant that runs an item; see shaders/lib/touch.glsl.
enum class TouchClass : uint8_t {
  kRows,   // small, and the bounding box is a row of cells: all are touched, no test needed
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
  std::vector<uint8_t> axes;         // dominant axis per triangle
  std::vector<WorkItemWords> items;  // by class, then image, then cost
  std::vector<ItemRange> ranges;     // non-empty ones, in the order of items
  // Runs of triangles of one image, for the raster pipeline.
  struct ImageRun {
    int image = -1;
    size_t first = 0, count = 0;
  };
  std::vector<ImageRun> image_runs;
  // Blocks of 64^3 cells that may be touched: one bit per block, by its Morton index in the tile.
  uint64_t blocks = 0;

  size_t triangle_count() const { return axes.size(); }
};

// Columns along a side of a work item, 1..16. Large items share the set-up of a triangle. Small
// ones keep devices with thousands of lanes busy.
struct ItemSizes {
  int block_columns = 16;
};
inline constexpr int kHardwareBlockColumns = 4;

// The most triangles of one window. Their 19 MB of vertices and 52 MB of attributes stay far below
// the 128 MiB that storage buffers have on software drivers. One window serves most tiles.
inline constexpr size_t kWindowTrianglesMax = size_t{1} << 19;
// The most work items of one window, 16 MiB. A window that would have more is made of fewer
// triangles.
inline constexpr size_t kWindowItemsMax = size_t{1} << 21;

// Fills `window` from `triangles`, a part of a bin. part_images: part_image() of every part.
// Returns false if there are more than kWindowItemsMax items; `window` is then unusable. A single
// triangle never has that many.
bool fill_tile_window(const SnappedMesh& mesh, const GridSpec& spec, const glm::ivec3& tile_coord,
                      std::span<const uint32_t> triangles, std::span<const int> part_images,
                      const ItemSizes& sizes, TileWindow& window);

// Last cell of the tile that is inside the grid, on each axis.
glm::ivec3 tile_cell_max(const GridSpec& spec, const glm::ivec3& tile_coord);

// Corner numbers 0..2 in ascending order of position (x, then y, then z), and whether that order
// reverses the triangle's orientation. Attributes are computed in this order, so that the file's
// order of corners does not change a byte.
struct CornerOrder {
  std::array<uint8_t, 3> corner{0, 1, 2};
  bool reversed = false;
};
CornerOrder corner_order(const std::array<glm::ivec3, 3>& q);

// The dominant axis of the integer normal. If several components are largest, z wins over x, and x
// over y. A triangle without area takes the axis in which it is shortest, with the same order of
// ties.
int dominant_axis(const std::array<glm::ivec3, 3>& q);

}  // namespace voxeld
