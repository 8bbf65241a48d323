// Pipeline compute: one invocation per work item finds the crossings of a block's columns with a
// triangle. In Schwarz & Seidel 2010, "Fast parallel surface and solid voxelization on GPUs",
// threads flip all cells below, a word each. Here one bit flips, and solid_scan.comp does the rest.
// SOLID_COUNT: signs are added up instead.
#include "shared/solid.h"
#include "shared/voxelize.h"
#include "lib/crossings.glsl"
#include "lib/touch_item.glsl"

layout(local_size_x = SOLID_GROUP_SIZE) in;
layout(std430, binding = SOLID_TRIANGLES) readonly buffer Triangles { int triangles[]; };
layout(std430, binding = SOLID_ITEMS) readonly buffer Items { uvec2 items[]; };
layout(std140, binding = SOLID_PARAMS) uniform Params { SolidParams params; };
#include "lib/solid_mark.glsl"

ivec3 item_corner(WorkItem item, uint corner) {
  uint at = item.triangle * 9u + corner * 3u;
  return 2 * ivec3(triangles[at], triangles[at + 1u], triangles[at + 2u]) + 1;
}

void main() {
  uint groups = (params.item_count + uint(SOLID_GROUP_SIZE) - 1u) / uint(SOLID_GROUP_SIZE);
  uint group = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
  if (group >= groups) return;
  uint index = dealt_group(group, groups) * uint(SOLID_GROUP_SIZE) + gl_LocalInvocationIndex;
  if (index >= params.item_count) return;
  WorkItem item = unpack_item(items[params.item_first + index]);
  ColumnTriangle t =
      crossing_setup(item_corner(item, 0u), item_corner(item, 1u), item_corner(item, 2u));
  if (t.normal.z == int64_t(0)) return;
  for (int v = item.first.y; v <= item.last.y; ++v) {
    for (int u = item.first.x; u <= item.last.x; ++u) {
      if (!crossing_inside(t, u, v)) continue;
      mark_crossing(u, v, crossing_first_cell(t, u, v), t.winding);
    }
  }
}
