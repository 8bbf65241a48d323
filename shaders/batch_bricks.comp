// Third pass of a batch: sets a bit for each brick of the masks that has a voxel. One invocation
// per brick, two words per group.
#include "shared/voxelize_batch.h"

layout(local_size_x = BATCH_GROUP_SIZE) in;
layout(std430, binding = BATCH_MASKS) readonly buffer Masks { uvec4 masks[]; };
layout(std430, binding = BATCH_BRICK_BITS) writeonly buffer Bits { uint brick_bits[]; };
layout(std140, binding = BATCH_PARAMS) uniform Params { BatchParams params; };

shared uint words[2];

void main() {
  uint group = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
  if (group >= params.slot_count * uint(BATCH_TILE_BRICKS / BATCH_GROUP_SIZE)) return;
  uint lane = gl_LocalInvocationIndex;
  if (lane < 2u) words[lane] = 0u;
  barrier();
  uint at = 4u * (group * uint(BATCH_GROUP_SIZE) + lane);
  uvec4 any_bits = masks[at] | masks[at + 1u] | masks[at + 2u] | masks[at + 3u];
  if (any_bits != uvec4(0u)) atomicOr(words[lane >> 5], 1u << (lane & 31u));
  barrier();
  if (lane < 2u) brick_bits[2u * group + lane] = words[lane];
}
