// Pipeline raster: the fragment of a column walks the depth range of the triangle's plane. It sets
// the bits of the cells that pass the exact test and, with RULE_THIN or RULE_CENTER, the rule's
// test.
#include "shared/voxelize.h"
#include "lib/touch.glsl"
#include "lib/touch_mask.glsl"
#if defined(RULE_THIN) || defined(RULE_CENTER)
#define HAS_CROSSHAIR
#include "lib/crosshair.glsl"
Crosshair crosshair;  // of the current triangle
#endif

layout(std430, binding = VOXELIZE_TRIANGLES) readonly buffer Triangles { int triangles[]; };
layout(std430, binding = VOXELIZE_MASK) buffer Mask { uint mask[]; };
layout(std140, binding = VOXELIZE_PARAMS) uniform Params { VoxelizeParams params; };

flat in uint triangle;
flat in int axis;

void visit_cell(int i, int j, int k) {
#ifdef HAS_CROSSHAIR
  if (!crosshair_meets(crosshair, ivec3(i, j, k))) return;
#endif
  uint m = tile_morton(i, j, k, axis);
  atomicOr(mask[m >> 5], 1u << (m & 31u));
}
void begin_column(TouchTriangle t, int i, int j) {}
#include "lib/touch_columns.glsl"

ivec3 triangle_vertex(uint corner) {
  uint at = triangle * 9u + corner * 3u;
  return touch_swizzle(ivec3(triangles[at], triangles[at + 1u], triangles[at + 2u]), axis);
}

void main() {
  ivec3 cell_last = touch_swizzle(params.cell_max.xyz, axis);
  ivec3 v0 = triangle_vertex(0u), v1 = triangle_vertex(1u), v2 = triangle_vertex(2u);
  TouchTriangle t = touch_setup(v0, v1, v2, cell_last);
  ivec2 column = ivec2(gl_FragCoord.xy);
  if (any(lessThan(column, t.cell_min.xy)) || any(greaterThan(column, t.cell_max.xy))) return;
#ifdef HAS_CROSSHAIR
  crosshair = crosshair_setup(v0, v1, v2);
#endif
  visit_one_column(t, column.x, column.y);
}
