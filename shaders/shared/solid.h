// Parameters, bindings and layouts of the passes that find insides, for C++ and GLSL.
#ifdef __cplusplus
#pragma once
#endif
#include "shaders/shared/types.h"

// Storage buffers.
#define SOLID_TRIANGLES 0   // 9 ints per triangle: u v w of three corners, see SolidParams
#define SOLID_ITEMS 1       // uvec2 per work item as in voxelize.h, or uint per crossing
#define SOLID_VOLUME 2      // bits or counts of a tile, see below
#define SOLID_CARRIES 3     // bit or int per column and slot: the state at the tile's lower end
#define SOLID_COUNTS 4      // ints of a slab: sums of signs
#define SOLID_THRESHOLDS 5  // ints of a slab, see below
// Bindings of the pass that makes cells.
#define SOLID_VOLUME_X 0
#define SOLID_VOLUME_Y 1
#define SOLID_VOLUME_Z 2
#define SOLID_DISAGREE 3  // mask like SOLID_MASK: cells on which the axes disagree
#define SOLID_MASK 6      // bit per cell of the tile in Morton order, proto/codec/sparse_tile.h
#define SOLID_FLAGS 7     // uints, see below
// Bindings of the flood.
#define SOLID_FREE 0  // bit per cell of the grid, see solid_flood.comp
#define SOLID_REACHED 1
#define SOLID_CHANGED 2  // uint: 1 if a step reached a new cell
// Uniform buffer.
#define SOLID_PARAMS 0
// Texture units of the slice map: slices 0 to 127 and 128 to 255.
#define SOLID_SLICES_LOW 0
#define SOLID_SLICES_HIGH 1

#define SOLID_GROUP_SIZE 64       // invocations of a work group
#define SOLID_TILE_CELLS 256      // along a side
#define SOLID_TILE_COLUMNS 65536  // column = v * 256 + u
#define SOLID_SLAB_CELLS 32       // cells along w that are counted at a time
#define SOLID_COLUMN_WORDS 8      // words that hold the bits of a column

// Bits of a tile: bit w & 31 of word (w >> 5) * SOLID_TILE_COLUMNS + column.
// Counts of a slab: int (w & 31) * SOLID_TILE_COLUMNS + column.
// Carries: bit column & 31 of word slot * 2048 + column / 32, or of counts int `column`.
#define SOLID_CARRY_WORDS 2048
// Thresholds of a slab, the cells [first, first + 32) along z: one int for each brick, x fastest. A
// value SOLID_MIXED + n or more means that the brick's 512 cells, x fastest, begin at
// SOLID_SLAB_BRICKS + 512 n.
#define SOLID_SLAB_BRICKS 4096
#define SOLID_MIXED 0x40000000

// Flags of each block of 64^3 cells. First come those of cells: bit 0: some are inside, bit 1: some
// are not. The same for disagreement follows, then the number of cells that some axis finds inside.
#define SOLID_FLAG_CELLS 0
#define SOLID_FLAG_DISAGREE 64
#define SOLID_FLAG_INSIDE 128
#define SOLID_FLAG_COUNT 192

VOXELD_SHARED_BEGIN

// Columns run along w; (u, v, w) are the axes rotated cyclically. Corners are integers q, in 1/256
// voxel from the tile's min corner, and are at q + 1/2.
struct SolidParams {
  ivec4 cells;      // xyz: cells of the tile that are inside the grid; w unused
  ivec4 columns;    // xy: last column in u and v that is inside the grid
  uint item_first;  // index of this dispatch's first work item
  uint item_count;
  uint triangle_first;  // raster: index of this draw's first triangle
  int cell_first;       // along w, in the tile; crossings of other cells are ignored
  int cell_last;
  int is_lowest;  // crossings below cell_first count as at cell_first
  uint carry_slot;
  uint slab;           // number of the slab in the tile
  int has_thresholds;  // 0: all are 1
  uint padding0, padding1, padding2;
};

struct FloodParams {
  ivec4 cells;  // xyz: of the grid; w unused
  int axis;     // the axis of this step
  int words_x;  // words of a row
  uint lines;   // rows or columns of words along the axis
  uint padding0;
};

VOXELD_SHARED_END

#ifdef __cplusplus
static_assert(offsetof(voxeld::shared::SolidParams, item_first) == 32);
static_assert(offsetof(voxeld::shared::SolidParams, carry_slot) == 56);
static_assert(sizeof(voxeld::shared::SolidParams) == 80);
static_assert(offsetof(voxeld::shared::FloodParams, axis) == 16);
static_assert(sizeof(voxeld::shared::FloodParams) == 32);
#endif
