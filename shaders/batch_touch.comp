// Second pass of a batch, run once for each list: one invocation per work item sets the bits of the
// cells that a triangle occupies in a block of columns. BATCH_OF_LARGE selects the list of large
// triangles. TOUCH_INT and TOUCH_INT3 are the integers of the plane test (lib/touch_int.glsl).
// RULE_THIN, RULE_CENTER: only those touched cells that the triangle occupies by that rule.
#include "shared/voxelize.h"
#include "shared/voxelize_batch.h"
#include "lib/touch.glsl"
#include "lib/touch_item.glsl"
#include "lib/touch_mask.glsl"
#if defined(RULE_THIN) || defined(RULE_CENTER)
#define HAS_CROSSHAIR
#include "lib/crosshair.glsl"
Crosshair crosshair;  // of the current triangle
#endif

layout(local_size_x = BATCH_GROUP_SIZE) in;
layout(std430, binding = BATCH_VERTICES) readonly buffer Vertices { int vertices[]; };
layout(std430, binding = BATCH_TRIANGLES) readonly buffer Triangles { uvec4 triangles[]; };
layout(std430, binding = BATCH_MASKS) buffer Masks { uint masks[]; };
layout(std430, binding = BATCH_ITEMS) readonly buffer Items { uvec2 items[]; };
layout(std430, binding = BATCH_COUNTS) readonly buffer Counts { BatchCounts counts; };
layout(std140, binding = BATCH_PARAMS) uniform Params { BatchParams params; };
#include "lib/batch_vertex.glsl"

// Bits of two words are gathered and written once. A row of cells along a triangle mostly stays
// within two words, one above the other.
uint word0 = 0u, bits0 = 0u, word1 = 0u, bits1 = 0u;
int item_axis;
uint mask_first;  // first word of the slot's mask

void visit_cell(int i, int j, int k) {
#ifdef HAS_CROSSHAIR
  if (!crosshair_meets(crosshair, ivec3(i, j, k))) return;
#endif
  uint m = tile_morton(i, j, k, item_axis);
  uint word = m >> 5;
  if (word != word0) {
    uint bits = 0u;
    if (word == word1) {
      bits = bits1;
    } else if (bits1 != 0u) {
      atomicOr(masks[mask_first + word1], bits1);
    }
    word1 = word0;
    bits1 = bits0;
    word0 = word;
    bits0 = bits;
  }
  bits0 |= 1u << (m & 31u);
}
void begin_column(TouchTriangle t, int i, int j) {}
#include "lib/touch_columns.glsl"

void main() {
  uint group = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
  uint index = group * uint(BATCH_GROUP_SIZE) + gl_LocalInvocationIndex;
  if (index >= params.dispatch_items) return;
  index += params.item_first;
#ifdef BATCH_OF_LARGE
  uint count = min(counts.large_count, params.large_capacity);
#else
  uint count = min(counts.small_count, params.small_capacity);
#endif
  if (index >= count) return;
  uvec2 words = items[index];
  WorkItem item = unpack_item(words);
  item_axis = item.axis;
  uint slot = words.y >> BATCH_ITEM_SLOT_SHIFT;
  mask_first = slot * uint(BATCH_TILE_MASK_WORDS);
  ivec3 tile = params.tiles[slot].xyz;
  ivec3 v0 = touch_swizzle(batch_vertex(item.triangle, 0u, tile), item.axis);
  ivec3 v1 = touch_swizzle(batch_vertex(item.triangle, 1u, tile), item.axis);
  ivec3 v2 = touch_swizzle(batch_vertex(item.triangle, 2u, tile), item.axis);
  ivec3 cell_last = min(ivec3(VOXELIZE_TILE_CELLS), params.dims.xyz - tile) - 1;
#ifdef HAS_CROSSHAIR
  crosshair = crosshair_setup(v0, v1, v2);
#endif
  visit_block(touch_setup(v0, v1, v2, touch_swizzle(cell_last, item.axis)), item.first, item.last);
  if (bits0 != 0u) atomicOr(masks[mask_first + word0], bits0);
  if (bits1 != 0u) atomicOr(masks[mask_first + word1], bits1);
}
