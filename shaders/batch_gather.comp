// Fifth pass of a batch: copies the occupied bricks to their places. One invocation per brick.
#include "shared/voxelize_batch.h"

layout(local_size_x = BATCH_GROUP_SIZE) in;
layout(std430, binding = BATCH_MASKS) readonly buffer Masks { uvec4 masks[]; };
layout(std430, binding = BATCH_BRICK_BITS) readonly buffer Bits { uint brick_bits[]; };
layout(std430, binding = BATCH_BRICK_RANKS) readonly buffer Ranks { uint brick_ranks[]; };
layout(std430, binding = BATCH_TILES) readonly buffer Tiles { BatchTile tiles[]; };
layout(std430, binding = BATCH_MORTONS) writeonly buffer Mortons { uint mortons[]; };
layout(std430, binding = BATCH_BRICKS) writeonly buffer Bricks { uvec4 bricks[]; };
layout(std140, binding = BATCH_PARAMS) uniform Params { BatchParams params; };

void main() {
  uint group = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
  uint brick = group * uint(BATCH_GROUP_SIZE) + gl_LocalInvocationIndex;
  uint slot = brick / uint(BATCH_TILE_BRICKS);
  if (slot >= params.slot_count) return;
  uint bits = brick_bits[brick >> 5], bit = 1u << (brick & 31u);
  if ((bits & bit) == 0u) return;
  uint at = tiles[slot].brick_first + brick_ranks[brick >> 5] + uint(bitCount(bits & (bit - 1u)));
  if (at >= params.brick_capacity) return;
  mortons[at] = brick & uint(BATCH_TILE_BRICKS - 1);
  for (uint n = 0u; n < 4u; ++n) bricks[4u * at + n] = masks[4u * brick + n];
}
