// Pipeline compute: one invocation per work item sets the bits of the cells that a triangle touches
// in a block of columns. TOUCH_INT and TOUCH_INT3 are the integers of the plane test. With
// TOUCH_ROWS every triangle lies in one row of cells, all of which it touches. With RULE_THIN or
// RULE_CENTER, only cells that it occupies by that rule are set.
#include "shared/voxelize.h"
#include "lib/touch.glsl"
#include "lib/touch_item.glsl"
#include "lib/touch_mask.glsl"
#if defined(RULE_THIN) || defined(RULE_CENTER)
#define HAS_CROSSHAIR
#include "lib/crosshair.glsl"
Crosshair crosshair;  // of the current triangle
#endif

layout(local_size_x = VOXELIZE_GROUP_SIZE) in;
layout(std430, binding = VOXELIZE_TRIANGLES) readonly buffer Triangles { int triangles[]; };
layout(std430, binding = VOXELIZE_ITEMS) readonly buffer Items { uvec2 items[]; };
layout(std430, binding = VOXELIZE_MASK) buffer Mask { uint mask[]; };
layout(std140, binding = VOXELIZE_PARAMS) uniform Params { VoxelizeParams params; };

// Bits of one word are gathered and written once, because neighbouring cells mostly share a word.
uint pending_word = 0u;
uint pending_bits = 0u;
int item_axis;

void flush_bits() {
  if (pending_bits != 0u) atomicOr(mask[pending_word], pending_bits);
}

void visit_cell(int i, int j, int k) {
#ifdef HAS_CROSSHAIR
  if (!crosshair_meets(crosshair, ivec3(i, j, k))) return;
#endif
  uint m = tile_morton(i, j, k, item_axis);
  if ((m >> 5) != pending_word) {
    flush_bits();
    pending_word = m >> 5;
    pending_bits = 0u;
  }
  pending_bits |= 1u << (m & 31u);
}

#ifndef TOUCH_ROWS
void begin_column(TouchTriangle t, int i, int j) {}
#include "lib/touch_columns.glsl"
#endif

ivec3 item_vertex(WorkItem item, uint corner) {
  uint at = item.triangle * 9u + corner * 3u;
  return touch_swizzle(ivec3(triangles[at], triangles[at + 1u], triangles[at + 2u]), item.axis);
}

void main() {
  uint groups = (params.item_count + uint(VOXELIZE_GROUP_SIZE) - 1u) / uint(VOXELIZE_GROUP_SIZE);
  uint group = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
  if (group >= groups) return;
  uint index = dealt_group(group, groups) * uint(VOXELIZE_GROUP_SIZE) + gl_LocalInvocationIndex;
  if (index >= params.item_count) return;
  WorkItem item = unpack_item(items[params.item_first + index]);
  item_axis = item.axis;
  ivec3 v0 = item_vertex(item, 0u), v1 = item_vertex(item, 1u), v2 = item_vertex(item, 2u);
  ivec3 cell_last = touch_swizzle(params.cell_max.xyz, item.axis);
#ifdef TOUCH_ROWS
  ivec3 low = max(min(v0, min(v1, v2)) >> 8, ivec3(0));
  ivec3 high = min(max(v0, max(v1, v2)) >> 8, cell_last);
  ivec3 direction = sign(high - low);
  int last = high.x - low.x + high.y - low.y + high.z - low.z;
  for (int n = 0; n <= last; ++n) {
    visit_cell(low.x + n * direction.x, low.y + n * direction.y, low.z + n * direction.z);
  }
#else
#ifdef HAS_CROSSHAIR
  crosshair = crosshair_setup(v0, v1, v2);
#endif
  visit_block(touch_setup(v0, v1, v2, cell_last), item.first, item.last);
#endif
  flush_bits();
}
