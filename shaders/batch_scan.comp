// Fourth pass of a batch: one group per tile counts its occupied bricks before every word of brick
// bits (a prefix sum; Hillis & Steele 1986 over the group). It then reserves their place among the
// bricks of the batch.
#include "shared/voxelize_batch.h"

layout(local_size_x = BATCH_SCAN_SIZE) in;
layout(std430, binding = BATCH_BRICK_BITS) readonly buffer Bits { uint brick_bits[]; };
layout(std430, binding = BATCH_BRICK_RANKS) writeonly buffer Ranks { uint brick_ranks[]; };
layout(std430, binding = BATCH_TILES) writeonly buffer Tiles { BatchTile tiles[]; };
layout(std430, binding = BATCH_COUNTS) buffer Counts { BatchCounts counts; };

shared uint sums[BATCH_SCAN_SIZE];

const uint kWords = uint(BATCH_TILE_BRICK_WORDS / BATCH_SCAN_SIZE);  // words per invocation

void main() {
  uint slot = gl_WorkGroupID.x;
  uint lane = gl_LocalInvocationIndex;
  uint first = slot * uint(BATCH_TILE_BRICK_WORDS) + lane * kWords;
  uint own = 0u;
  for (uint w = 0u; w < kWords; ++w) own += uint(bitCount(brick_bits[first + w]));
  sums[lane] = own;
  barrier();
  for (uint step = 1u; step < uint(BATCH_SCAN_SIZE); step *= 2u) {
    uint before = lane >= step ? sums[lane - step] : 0u;
    barrier();
    sums[lane] += before;
    barrier();
  }
  uint rank = sums[lane] - own;
  for (uint w = 0u; w < kWords; ++w) {
    brick_ranks[first + w] = rank;
    rank += uint(bitCount(brick_bits[first + w]));
  }
  if (lane == uint(BATCH_SCAN_SIZE) - 1u) {
    tiles[slot].brick_first = atomicAdd(counts.brick_count, rank);
    tiles[slot].brick_count = rank;
  }
}
