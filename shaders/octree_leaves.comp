// Third pass of the octrees of a batch: the nodes of 4 and of 2 cells of each brick, which are the
// nonzero bytes of its mask. One invocation per brick.
#include "shared/voxelize_batch.h"

layout(local_size_x = BATCH_GROUP_SIZE) in;
layout(std430, binding = BATCH_MASKS) readonly buffer Masks { uvec4 masks[]; };
layout(std430, binding = OCTREE_BRICKS) readonly buffer Bricks { uint bricks[]; };
layout(std430, binding = OCTREE_PLACES) readonly buffer Places { uvec2 places[]; };
layout(std140, binding = BATCH_PARAMS) uniform Params { BatchParams params; };
#include "lib/octree_bytes.glsl"

uvec2 place;

// Writes half a node of 4 cells, i.e. four nodes of 2 cells. Returns the bits of those with voxels.
uint put_nodes2(uint word) {
  uint bits = 0u;
  for (uint n = 0u; n < 4u; ++n) {
    uint byte = (word >> (8u * n)) & 255u;
    if (byte == 0u) continue;
    put_byte(place.y++, byte);
    bits |= 1u << n;
  }
  return bits;
}

void put_node4(uint low, uint high) {
  if ((low | high) == 0u) return;
  uint byte = put_nodes2(low);
  byte |= put_nodes2(high) << 4;
  put_byte(place.x++, byte);
}

void main() {
  uint group = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
  uint brick = group * uint(BATCH_GROUP_SIZE) + gl_LocalInvocationIndex;
  if (brick >= params.slot_count * uint(BATCH_TILE_BRICKS)) return;
  // A brick in a full node is itself full, so it is skipped too.
  uint found = bricks[brick];
  if ((found & OCTREE_ANY) == 0u || (found & OCTREE_FULL) != 0u) return;
  place = places[brick];
  for (uint n = 0u; n < 4u; ++n) {
    uvec4 words = masks[4u * brick + n];
    put_node4(words.x, words.y);
    put_node4(words.z, words.w);
  }
}
