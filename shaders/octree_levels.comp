// Second pass of the octrees of a batch, one group per tile. It reduces bricks to nodes of 16 to
// 256 cells by OR (has voxels) and AND (is full). Prefix sums then give the start of each level,
// and of each brick's nodes in the levels below it. Finally it writes the levels down to the
// bricks.
#include "shared/voxelize_batch.h"

layout(local_size_x = BATCH_SCAN_SIZE) in;
layout(std430, binding = OCTREE_BRICKS) readonly buffer Bricks { uint bricks[]; };
layout(std430, binding = OCTREE_PLACES) writeonly buffer Places { uvec2 places[]; };
layout(std430, binding = OCTREE_TILES) writeonly buffer Tiles { OctreeTile tiles[]; };
layout(std430, binding = OCTREE_COUNT) buffer Count { uint byte_total; };
layout(std140, binding = BATCH_PARAMS) uniform Params { BatchParams params; };
#include "lib/octree_bytes.glsl"

// Bits of the nodes of 32 cells (512), 64 cells (64) and 128 cells (8), in Morton order.
shared uint any32[16], full32[16], any64[2], full64[2], any128, full128;
// Sums over the invocations so far: nodes of 32, 16, 8 and 4 cells, and of 2.
shared uvec4 sums[BATCH_SCAN_SIZE];
shared uint sums2[BATCH_SCAN_SIZE];
// Starts of the levels of 256, 128, ... 2 cells, then the end.
shared uint level_first[9];

const uint kBricks = 128u;  // bricks per invocation: two nodes of 32 cells

bool bit_of(uint word, uint n) { return ((word >> (n & 31u)) & 1u) != 0u; }
uint byte_of(uint word, uint n) { return (word >> (8u * (n & 3u))) & 255u; }

// A node of 16 cells: bits 0..7 are its byte, bit 8 is set if it is full.
uint node16(uint first_brick) {
  uint node = 256u;
  for (uint n = 0u; n < 8u; ++n) {
    uint brick = bricks[first_brick + n];
    node |= (brick & OCTREE_ANY) << n;
    if ((brick & OCTREE_FULL) == 0u) node &= ~256u;
  }
  return node;
}

// Sets the bits of the two nodes of 32 cells.
void reduce(uint lane, uint first_brick) {
  for (uint n = 0u; n < 2u; ++n) {
    uint some = 0u, all = 256u;
    for (uint m = 0u; m < 8u; ++m) {
      uint node = node16(first_brick + 64u * n + 8u * m);
      some |= node & 255u;
      all &= node;
    }
    uint at = 2u * lane + n;
    if (some != 0u) atomicOr(any32[at >> 5], 1u << (at & 31u));
    if (all != 0u) atomicOr(full32[at >> 5], 1u << (at & 31u));
  }
}

// Reduces the levels above, and places their bytes from level_first[0] = 0 on.
void reduce_top() {
  for (uint n = 0u; n < 64u; ++n) {
    if (byte_of(any32[n >> 2], n) != 0u) any64[n >> 5] |= 1u << (n & 31u);
    if (byte_of(full32[n >> 2], n) == 255u) full64[n >> 5] |= 1u << (n & 31u);
  }
  for (uint n = 0u; n < 8u; ++n) {
    if (byte_of(any64[n >> 2], n) != 0u) any128 |= 1u << n;
    if (byte_of(full64[n >> 2], n) == 255u) full128 |= 1u << n;
  }
  level_first[0] = 0u;
  level_first[1] = any128 == 0u ? 0u : 1u;
  level_first[2] = level_first[1] + (full128 == 255u ? 0u : uint(bitCount(any128)));
  uint nodes64 = 0u;
  for (uint n = 0u; n < 8u; ++n) {
    if (!bit_of(full128, n)) nodes64 += uint(bitCount(byte_of(any64[n >> 2], n)));
  }
  level_first[3] = level_first[2] + nodes64;
}

// Writes the top levels. A full node has byte 0 and nothing below it.
void write_top(uint first) {
  if (any128 == 0u) return;
  put_byte(first, full128 == 255u ? 0u : any128);
  uint at128 = first + level_first[1], at64 = first + level_first[2];
  for (uint n = 0u; n < 8u; ++n) {
    if (full128 == 255u || !bit_of(any128, n)) continue;
    put_byte(at128++, bit_of(full128, n) ? 0u : byte_of(any64[n >> 2], n));
  }
  for (uint n = 0u; n < 64u; ++n) {
    if (bit_of(full128, n >> 3) || !bit_of(any64[n >> 5], n)) continue;
    put_byte(at64++, bit_of(full64[n >> 5], n) ? 0u : byte_of(any32[n >> 2], n));
  }
}

// Counts the nodes of this invocation below 64 cells. If `writes`, it writes them, from `at` (32,
// 16, 8 and 4 cells) and `at2` on.
void visit(uint lane, uint first_brick, bool writes, inout uvec4 at, inout uint at2) {
  for (uint n = 0u; n < 2u; ++n) {
    uint node = 2u * lane + n;
    if (bit_of(full64[node >> 8], node >> 3) || !bit_of(any32[node >> 5], node)) continue;
    bool is_full32 = bit_of(full32[node >> 5], node);
    uint byte32 = 0u;
    uint at32 = at.x++;
    for (uint m = 0u; m < 8u && !is_full32; ++m) {
      uint first = first_brick + 64u * n + 8u * m;
      uint found = node16(first);
      if ((found & 255u) == 0u) continue;
      byte32 |= 1u << m;
      bool is_full16 = (found & 256u) != 0u;
      if (writes) put_byte(at.y, is_full16 ? 0u : (found & 255u));
      at.y += 1u;
      for (uint b = 0u; b < 8u && !is_full16; ++b) {
        uint brick = bricks[first + b];
        if ((brick & OCTREE_ANY) == 0u) continue;
        if (writes) {
          put_byte(at.z, (brick >> OCTREE_BYTE_SHIFT) & 255u);
          places[first + b] = uvec2(at.w, at2);
        }
        at.z += 1u;
        at.w += (brick >> OCTREE_NODES4_SHIFT) & 63u;
        at2 += (brick >> OCTREE_NODES2_SHIFT) & 255u;
      }
    }
    if (writes) put_byte(at32, byte32);
  }
}

void main() {
  uint slot = gl_WorkGroupID.x;
  uint lane = gl_LocalInvocationIndex;
  uint first_brick = slot * uint(BATCH_TILE_BRICKS) + lane * kBricks;
  if (lane < 16u) any32[lane] = full32[lane] = 0u;
  if (lane < 2u) any64[lane] = full64[lane] = 0u;
  if (lane == 0u) any128 = full128 = 0u;
  barrier();
  reduce(lane, first_brick);
  barrier();
  if (lane == 0u) reduce_top();
  barrier();
  uvec4 own = uvec4(0u);
  uint own2 = 0u;
  visit(lane, first_brick, false, own, own2);
  sums[lane] = own;
  sums2[lane] = own2;
  barrier();
  for (uint step = 1u; step < uint(BATCH_SCAN_SIZE); step *= 2u) {
    uvec4 before = lane >= step ? sums[lane - step] : uvec4(0u);
    uint before2 = lane >= step ? sums2[lane - step] : 0u;
    barrier();
    sums[lane] += before;
    sums2[lane] += before2;
    barrier();
  }
  if (lane == uint(BATCH_SCAN_SIZE) - 1u) {
    uvec4 total = sums[lane];
    level_first[4] = level_first[3] + total.x;
    level_first[5] = level_first[4] + total.y;
    level_first[6] = level_first[5] + total.z;
    level_first[7] = level_first[6] + total.w;
    uint bytes = level_first[7] + sums2[lane];
    uint first = atomicAdd(byte_total, (bytes + 3u) & ~3u);
    level_first[8] = first;
    tiles[slot].byte_first = first;
    tiles[slot].byte_count = bytes;
  }
  barrier();
  uint first = level_first[8];
  if (lane == 0u) write_top(first);
  uvec4 at = first + sums[lane] - own +
             uvec4(level_first[3], level_first[4], level_first[5], level_first[6]);
  uint at2 = first + sums2[lane] - own2 + level_first[7];
  visit(lane, first_brick, true, at, at2);
}
