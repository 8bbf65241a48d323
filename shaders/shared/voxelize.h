// Parameters, bindings and work items of the voxelizing passes, read by C++ and GLSL.
#ifdef __cplusplus
#pragma once
#endif
#include "shaders/shared/types.h"

// Storage buffers.
#define VOXELIZE_TRIANGLES 0  // 9 ints per triangle: x y z of three vertices, see VoxelizeParams
#define VOXELIZE_ITEMS 1      // VoxelizeItem per work item; pipeline compute alone
#define VOXELIZE_MASK 2       // bit per cell of the tile in Morton order, proto/codec/sparse_tile.h
#define VOXELIZE_ATTRIBUTES 3    // ATTRIBUTE_WORDS uints per triangle, attributes.h
#define VOXELIZE_WORD_OFFSETS 4  // uint per mask word: number of the word's first voxel in the tile
#define VOXELIZE_SUMS 5          // uint: sums of the attributes, attributes.h
#define VOXELIZE_LINEAR 6        // 256 uints: 16-bit linear light of an sRGB byte
// Binding of voxelize_words, in place of VOXELIZE_TRIANGLES and VOXELIZE_ITEMS.
#define VOXELIZE_SMALL 0  // SmallTriangle per triangle
// Uniform buffer.
#define VOXELIZE_PARAMS 0
// Texture unit.
#define VOXELIZE_TEXTURE 0

#define VOXELIZE_GROUP_SIZE 64     // invocations of a work group
#define VOXELIZE_TILE_CELLS 256    // along a side
#define VOXELIZE_BLOCK_COLUMNS 16  // the most columns along a side of a work item

// A work item: x = triangle, y = its columns in the plane across the triangle's dominant axis.
//   bits  0..7   first column i        bits 16..19  columns in i, less 1
//   bits  8..15  first column j        bits 20..23  columns in j, less 1
//   bits 24..25  dominant axis
#define VOXELIZE_ITEM_J_SHIFT 8
#define VOXELIZE_ITEM_NI_SHIFT 16
#define VOXELIZE_ITEM_NJ_SHIFT 20
#define VOXELIZE_ITEM_AXIS_SHIFT 24

// SmallTriangle, for triangles at most VOXELIZE_SMALL_EXTENT wide on each axis. Corners are counted
// from the box's first cell, in 1/256 voxel; a word of the mask is 4x4x2 cells.
//   corners.x, y, z  bits 0..15: x, y, z of corner 0; bits 16..31: of corner 1
//   corners.w        bits 0..15: x of corner 2; bits 16..31: y of corner 2
//   place.x          z of corner 2
//   place.y          the box's first cell in the tile, which may lie outside, on each axis plus
//                    VOXELIZE_SMALL_BIAS: bits 0..9 x, 10..19 y, 20..29 z
//   place.z          words of the mask that the box reaches inside the tile, the first one:
//                    bits 0..5 x, 6..11 y, 12..18 z; and how many, less 1: 19..21 x, 22..24 y,
//                    25..28 z
//   place.w          bits 0..7: the tile's slot among the masks; then cells from the box's first
//                    one to the last one that is inside the grid, or VOXELIZE_SMALL_LAST_MAX where
//                    they are more: 8..12 x, 13..17 y, 18..22 z
#define VOXELIZE_SMALL_EXTENT 4096
#define VOXELIZE_SMALL_BIAS 64
#define VOXELIZE_SMALL_CELL_BITS 10
#define VOXELIZE_SMALL_WORD_Y_SHIFT 6
#define VOXELIZE_SMALL_WORD_Z_SHIFT 12
#define VOXELIZE_SMALL_COUNT_X_SHIFT 19
#define VOXELIZE_SMALL_COUNT_Y_SHIFT 22
#define VOXELIZE_SMALL_COUNT_Z_SHIFT 25
#define VOXELIZE_SMALL_SLOT_BITS 8
#define VOXELIZE_SMALL_LAST_BITS 5
#define VOXELIZE_SMALL_LAST_MAX 31

VOXELD_SHARED_BEGIN

struct SmallTriangle {
  uvec4 corners;
  uvec4 place;
};

// Vertices are integers q, in 1/256 voxel from the tile's min corner; the vertex is at q + 1/2.
struct VoxelizeParams {
  ivec4 cell_max;   // xyz: last cell of the tile that is inside the grid; w unused
  uint item_first;  // index of this dispatch's first work item
  uint item_count;
  uint triangle_first;  // raster: index of this draw's first triangle
  uint voxel_first;     // attributes: voxels [voxel_first, voxel_first + voxel_count) of the tile
  uint voxel_count;
  uint padding0, padding1, padding2;
};

VOXELD_SHARED_END

#ifdef __cplusplus
static_assert(offsetof(voxeld::shared::VoxelizeParams, item_first) == 16);
static_assert(offsetof(voxeld::shared::VoxelizeParams, voxel_count) == 32);
static_assert(sizeof(voxeld::shared::VoxelizeParams) == 48);
static_assert(sizeof(voxeld::shared::SmallTriangle) == 32);
#endif
