// Marks crossings that the CPU found, which are those of triangles too large for 64 bits.
#include "shared/solid.h"

layout(local_size_x = SOLID_GROUP_SIZE) in;
// u, v, 8 bits each; first cell, 15 bits; faces down, 1 bit: server/voxel/solid/inside/crossings.h.
layout(std430, binding = SOLID_ITEMS) readonly buffer Crossings { uint crossings[]; };
layout(std140, binding = SOLID_PARAMS) uniform Params { SolidParams params; };
#include "lib/solid_mark.glsl"

void main() {
  uint group = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
  uint index = group * uint(SOLID_GROUP_SIZE) + gl_LocalInvocationIndex;
  if (index >= params.item_count) return;
  uint crossing = crossings[params.item_first + index];
  mark_crossing(int(crossing & 255u), int((crossing >> 8) & 255u),
                int((crossing >> 16) & 0x7fffu), (crossing >> 31) != 0u ? 1 : -1);
}
