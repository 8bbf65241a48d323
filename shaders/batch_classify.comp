// First pass of a batch: clears the masks, culls pairs of a triangle and a tile, and splits the
// rest into work items of up to 8x8 columns. Items go to the list of small or of large triangles.
// One atomic operation per group and list reserves their places.
#include "shared/voxelize.h"
#include "shared/voxelize_batch.h"
#include "lib/touch.glsl"
#include "lib/batch_counts.glsl"

layout(local_size_x = BATCH_GROUP_SIZE) in;
layout(std430, binding = BATCH_VERTICES) readonly buffer Vertices { int vertices[]; };
layout(std430, binding = BATCH_TRIANGLES) readonly buffer Triangles { uvec4 triangles[]; };
layout(std430, binding = BATCH_PAIRS) readonly buffer Pairs { uint pairs[]; };
layout(std430, binding = BATCH_GROUPS) readonly buffer Groups { uvec2 groups[]; };
layout(std430, binding = BATCH_MASKS) writeonly buffer Masks { uvec4 masks[]; };
layout(std430, binding = BATCH_SMALL) writeonly buffer Small { uvec2 small_items[]; };
layout(std430, binding = BATCH_LARGE) writeonly buffer Large { uvec2 large_items[]; };
layout(std140, binding = BATCH_PARAMS) uniform Params { BatchParams params; };
#include "lib/batch_vertex.glsl"

// State of the group: items of each list, where they go, and pairs with more blocks than bits.
shared uint small_items_of_group, large_items_of_group, small_base, large_base;
shared uint wide_count;
shared uint wide_pairs[BATCH_GROUP_SIZE];

// A triangle's rectangle of columns in the tile, in blocks.
struct Work {
  uint triangle;
  int axis;
  bool is_small;
  TouchTriangle t;
  ivec2 first, last;  // columns, inclusive
  ivec2 block_first;  // in blocks
  ivec2 blocks;       // 0 if the triangle misses the tile
};

Work work_of(uint triangle, uint slot) {
  Work work;
  work.triangle = triangle;
  ivec3 tile = params.tiles[slot].xyz;
  ivec3 v0 = batch_vertex(triangle, 0u, tile), v1 = batch_vertex(triangle, 1u, tile),
        v2 = batch_vertex(triangle, 2u, tile);
  ivec3 extent = max(v0, max(v1, v2)) - min(v0, min(v1, v2));
  work.is_small = max(extent.x, max(extent.y, extent.z)) <= TOUCH_SMALL_EXTENT;
  work.axis = touch_dominant_axis(v0, v1, v2);
  ivec3 cell_last = min(ivec3(VOXELIZE_TILE_CELLS), params.dims.xyz - tile) - 1;
  work.t = touch_setup(touch_swizzle(v0, work.axis), touch_swizzle(v1, work.axis),
                       touch_swizzle(v2, work.axis), touch_swizzle(cell_last, work.axis));
  work.first = work.t.cell_min.xy;
  work.last = work.t.cell_max.xy;
  work.block_first = work.first / BATCH_BLOCK_COLUMNS;
  bool misses = any(greaterThan(work.t.cell_min, work.t.cell_max));
  work.blocks = misses ? ivec2(0) : work.last / BATCH_BLOCK_COLUMNS - work.block_first + 1;
  return work;
}

// Columns of block n, inclusive: i, j of the first and of the last.
ivec4 columns_of(Work work, int n) {
  ivec2 block = work.block_first + ivec2(n % work.blocks.x, n / work.blocks.x);
  ivec2 first = block * BATCH_BLOCK_COLUMNS;
  return ivec4(max(first, work.first), min(first + BATCH_BLOCK_COLUMNS - 1, work.last));
}

bool edge_leaves(ivec3 edge, ivec4 c) {
  return edge.x * (edge.x > 0 ? c.z : c.x) + edge.y * (edge.y > 0 ? c.w : c.y) + edge.z >= 0;
}

// A conservative test of a block; the exact test is per work item.
bool may_touch(TouchTriangle t, ivec4 c) {
  if (!edge_leaves(t.xy0, c) || !edge_leaves(t.xy1, c) || !edge_leaves(t.xy2, c)) return false;
  if (touch_is_zero(t.normal.z)) return true;
  bool x_falls = touch_is_negative(t.normal.x), y_falls = touch_is_negative(t.normal.y);
  TOUCH_INT most = touch_height(t, x_falls ? c.x : c.z, y_falls ? c.y : c.w);
  TOUCH_INT least = touch_height(t, x_falls ? c.z : c.x, y_falls ? c.w : c.y);
  return touch_low(t, most) - TOUCH_MARGIN <= float(t.cell_max.z - t.base_z) &&
         touch_high(t, least) + TOUCH_MARGIN >= float(t.cell_min.z - t.base_z);
}

uvec2 item_of(Work work, int n, uint slot) {
  ivec4 c = columns_of(work, n);
  int columns = c.x | (c.y << VOXELIZE_ITEM_J_SHIFT) | ((c.z - c.x) << VOXELIZE_ITEM_NI_SHIFT) |
                ((c.w - c.y) << VOXELIZE_ITEM_NJ_SHIFT) | (work.axis << VOXELIZE_ITEM_AXIS_SHIFT);
  return uvec2(work.triangle, uint(columns) | (slot << BATCH_ITEM_SLOT_SHIFT));
}

void write_small(uint at, uvec2 item) {
  if (at < params.small_capacity) small_items[at] = item;
}
void write_large(uint at, uvec2 item) {
  if (at < params.large_capacity) large_items[at] = item;
}

// Items of a list that the first dispatch over it takes.
uint most_of(uint capacity) {
  return min(capacity, params.dispatch_items);
}

void clear_masks(uint group) {
  uint first = group * uint(BATCH_CLEAR_VECTORS) + gl_LocalInvocationIndex;
  for (uint n = 0u; n < uint(BATCH_CLEAR_VECTORS); n += uint(BATCH_GROUP_SIZE)) {
    if (first + n < params.clear_vectors) masks[first + n] = uvec4(0u);
  }
}

// The blocks that may be touched, of at most 32.
uint blocks_of(Work work) {
  int count = work.blocks.x * work.blocks.y;
  if (count <= 1) return uint(count);
  uint bits = 0u;
  for (int n = 0; n < count; ++n) {
    if (may_touch(work.t, columns_of(work, n))) bits |= 1u << n;
  }
  return bits;
}

// Splits one pair of many blocks; the whole group works on it.
void split_wide(uint pair, uint slot) {
  uint lane = gl_LocalInvocationIndex;
  Work work = work_of(pairs[pair], slot);
  int count = work.blocks.x * work.blocks.y;
  // There are at most 1024 blocks, 16 for each invocation.
  uint bits = 0u;
  for (int n = 0; n < 16; ++n) {
    int block = int(lane) + n * BATCH_GROUP_SIZE;
    if (block < count && may_touch(work.t, columns_of(work, block))) bits |= 1u << n;
  }
  if (lane == 0u) large_items_of_group = 0u;
  barrier();
  uint at = atomicAdd(large_items_of_group, uint(bitCount(bits)));
  barrier();
  if (lane == 0u) large_base = take_large(large_items_of_group, most_of(params.large_capacity));
  barrier();
  at += large_base;
  for (; bits != 0u; bits &= bits - 1u) {
    int block = int(lane) + findLSB(bits) * BATCH_GROUP_SIZE;
    write_large(at++, item_of(work, block, slot));
  }
}

void main() {
  uint group = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
  uint lane = gl_LocalInvocationIndex;
  clear_masks(group);
  if (group >= params.group_count) return;
  if (lane == 0u) {
    small_items_of_group = 0u;
    large_items_of_group = 0u;
    wide_count = 0u;
  }
  barrier();
  uvec2 range = groups[group];
  uint slot = range.y & 255u;
  uint bits = 0u, at = 0u;
  Work work;
  if (lane <= (range.y >> 8)) {
    work = work_of(pairs[range.x + lane], slot);
    if (work.blocks.x * work.blocks.y > 32) {
      wide_pairs[atomicAdd(wide_count, 1u)] = range.x + lane;
    } else {
      bits = blocks_of(work);
      uint count = uint(bitCount(bits));
      if (work.is_small) {
        at = atomicAdd(small_items_of_group, count);
      } else {
        at = atomicAdd(large_items_of_group, count);
      }
    }
  }
  barrier();
  if (lane == 0u) {
    small_base = take_small(small_items_of_group, most_of(params.small_capacity));
    large_base = take_large(large_items_of_group, most_of(params.large_capacity));
  }
  barrier();
  for (; bits != 0u; bits &= bits - 1u) {
    uvec2 item = item_of(work, findLSB(bits), slot);
    if (work.is_small) {
      write_small(small_base + at++, item);
    } else {
      write_large(large_base + at++, item);
    }
  }
  uint wide = wide_count;
  for (uint n = 0u; n < wide; ++n) {
    barrier();
    split_wide(wide_pairs[n], slot);
  }
}
