// Parameters, bindings and lists of the passes that find the occupied cells of a batch of tiles,
// for C++ and GLSL. The CPU prepares nothing per triangle. The passes, in order:
//   batch_classify  clears the masks; pairs of a triangle and a tile -> work items, in two lists
//   batch_touch     work items -> bits of the masks; once for each list
//   batch_bricks    masks -> which bricks are occupied
//   batch_scan      -> how many are before each
//   batch_gather    -> the occupied bricks alone
// Passes for the tiles' octrees, breadth first, in the format of proto/container/grid_format.h:
//   octree_bricks   masks -> what each brick adds to the levels below it
//   octree_levels   -> where each level and each brick begins, and the levels down to the bricks
//   octree_leaves   -> the levels of 4 and of 2 cells
#ifdef __cplusplus
#pragma once
#endif
#include "shaders/shared/types.h"

// Storage buffers.
#define BATCH_VERTICES 0   // 3 ints per vertex: q in grid space, 1/256 voxel
#define BATCH_TRIANGLES 1  // uvec4 per triangle: three vertices, and the part
#define BATCH_PAIRS 2      // uint per pair of a tile and a triangle: the triangle; tile after tile
#define BATCH_GROUPS 3     // uvec2 per group of pairs: the first; slot | (pairs - 1) << 8
#define BATCH_MASKS 4      // per slot: the tile's mask, VOXELIZE_MASK of voxelize.h
#define BATCH_SMALL 5      // uvec2 per work item for 32-bit integers; layout below
#define BATCH_LARGE 6      // uvec2 per work item for wider ones
#define BATCH_COUNTS 7     // BatchCounts
// Binding of batch_touch, in place of BATCH_SMALL and BATCH_LARGE.
#define BATCH_ITEMS 5
// Bindings of the brick passes, besides BATCH_MASKS and BATCH_COUNTS.
#define BATCH_BRICK_BITS 0  // uint per 32 bricks of a slot: occupied ones
#define BATCH_BRICK_RANKS \
  1                      // uint per 32 bricks of a slot: occupied bricks of the slot before them
#define BATCH_TILES 2    // BatchTile per slot
#define BATCH_MORTONS 3  // uint per occupied brick, ascending within a tile
#define BATCH_BRICKS 5   // 16 uints per occupied brick
// Bindings of the octree passes, besides BATCH_MASKS.
#define OCTREE_BRICKS 0  // uint per brick of a slot; layout below
#define OCTREE_PLACES 1  // uvec2 per brick of a slot: bytes where its nodes of 4 and 2 cells begin
#define OCTREE_TILES 2   // OctreeTile per slot
#define OCTREE_BYTES 3   // the octrees, four bytes in a word; zero before
#define OCTREE_COUNT 5   // uint: bytes of all octrees, each rounded up to whole words
// Uniform buffer.
#define BATCH_PARAMS 0

// The summary of a brick by octree_bricks: any voxel, all voxels, the number of nodes of 4 and of 2
// cells with voxels in its stream, and its byte.
#define OCTREE_ANY 1u
#define OCTREE_FULL 2u
#define OCTREE_NODES4_SHIFT 2
#define OCTREE_NODES2_SHIFT 8
#define OCTREE_BYTE_SHIFT 16

#define BATCH_GROUP_SIZE 64       // invocations of a work group, and pairs of one
#define BATCH_SLOTS_MAX 64        // tiles of a batch: 6 bits of a work item
#define BATCH_CLEAR_VECTORS 1024  // uvec4 of the masks that one group of batch_classify clears
#define BATCH_BLOCK_COLUMNS 8     // along a side of a work item: 64 columns of at most 257 cells
#define BATCH_TILE_MASK_WORDS 524288
#define BATCH_TILE_BRICKS 32768
#define BATCH_TILE_BRICK_WORDS 1024
#define BATCH_SCAN_SIZE 256  // invocations of batch_scan, which takes a tile in one group
// More groups than this in x are folded into y, because OpenGL has 65,535 on each axis.
#define BATCH_FOLD 32768

// A work item: x = triangle; y as VOXELIZE_ITEM_... in voxelize.h, and the slot from here on.
#define BATCH_ITEM_SLOT_SHIFT 26

VOXELD_SHARED_BEGIN

struct BatchParams {
  ivec4 dims;           // xyz: cells of the grid; w unused
  uint group_count;     // groups of pairs
  uint clear_vectors;   // uvec4 of the masks to clear; 0 after the first window of a batch
  uint small_capacity;  // work items that the lists hold; more are counted and not written
  uint large_capacity;
  uint slot_count;
  uint item_first;      // work items of a dispatch of batch_touch: the first,
  uint dispatch_items;  // and how many at most
  uint brick_capacity;           // occupied bricks that fit, as with work items
  uint has_full_nodes;           // octrees: 1 if voxels have no attributes
  uint octree_words;             // octrees: words that fit
  uint unused0, unused1;
  ivec4 tiles[BATCH_SLOTS_MAX];  // xyz: the tile's first cell in the grid; w unused
};

// Counts of a batch; x, y, z are arguments of an indirect dispatch. The first two lines are reset
// for each window.
struct BatchCounts {
  uint small_count, small_x, small_y, small_z;
  uint large_count, large_x, large_y, large_z;
  uint small_needed, large_needed;  // largest counts of all windows
  uint item_count;                  // sum over all windows
  uint brick_count;                 // sum over all tiles
};

struct BatchTile {
  uint brick_first;  // place of the tile's bricks among those of the batch
  uint brick_count;
};

struct OctreeTile {
  uint byte_first;  // among the bytes of the batch; a multiple of 4
  uint byte_count;
};

VOXELD_SHARED_END

#ifdef __cplusplus
static_assert(offsetof(voxeld::shared::BatchParams, group_count) == 16);
static_assert(offsetof(voxeld::shared::BatchParams, tiles) == 64);
static_assert(sizeof(voxeld::shared::BatchCounts) == 48);
static_assert(sizeof(voxeld::shared::BatchTile) == 8);
#endif
