// First pass of the octrees of a batch: summarizes each brick for the counts of the levels. One
// invocation per brick.
#include "shared/voxelize_batch.h"

layout(local_size_x = BATCH_GROUP_SIZE) in;
layout(std430, binding = BATCH_MASKS) readonly buffer Masks { uvec4 masks[]; };
layout(std430, binding = OCTREE_BRICKS) writeonly buffer Bricks { uint bricks[]; };
layout(std140, binding = BATCH_PARAMS) uniform Params { BatchParams params; };

uint nonzero_bytes(uint word) {
  word |= word >> 4;
  word |= word >> 2;
  word |= word >> 1;
  return uint(bitCount(word & 0x01010101u));
}

void main() {
  uint group = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
  uint brick = group * uint(BATCH_GROUP_SIZE) + gl_LocalInvocationIndex;
  if (brick >= params.slot_count * uint(BATCH_TILE_BRICKS)) return;
  uint byte = 0u, nodes4 = 0u, nodes2 = 0u, all_bits = 0xffffffffu;
  for (uint n = 0u; n < 4u; ++n) {
    // Each vector is two nodes of 4 cells.
    uvec4 words = masks[4u * brick + n];
    all_bits &= words.x & words.y & words.z & words.w;
    byte |= ((words.x | words.y) != 0u ? 1u : 0u) << (2u * n);
    byte |= ((words.z | words.w) != 0u ? 2u : 0u) << (2u * n);
    nodes2 += nonzero_bytes(words.x) + nonzero_bytes(words.y) + nonzero_bytes(words.z) +
              nonzero_bytes(words.w);
  }
  nodes4 = uint(bitCount(byte));
  bool is_full = all_bits == 0xffffffffu && params.has_full_nodes != 0u;
  uint found = (nodes4 << OCTREE_NODES4_SHIFT) | (nodes2 << OCTREE_NODES2_SHIFT) |
               (byte << OCTREE_BYTE_SHIFT);
  if (is_full) found = OCTREE_FULL;  // no children in the stream, and byte 0
  bricks[brick] = byte == 0u ? 0u : (found | OCTREE_ANY);
}
