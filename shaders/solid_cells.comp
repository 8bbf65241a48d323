// Converts the bits of columns to a tile's mask in Morton order, words of 4x4x2 cells. One
// invocation makes 16 words, one above the other, because most are empty or full. SOLID_VOTE:
// majority of the three axes, and the cells on which they disagree.
#include "shared/solid.h"

layout(local_size_x = SOLID_GROUP_SIZE) in;
layout(std430, binding = SOLID_VOLUME_Z) readonly buffer VolumeZ { uint volume_z[]; };
layout(std430, binding = SOLID_MASK) buffer Mask { uint mask[]; };
layout(std430, binding = SOLID_FLAGS) buffer Flags { uint flags[]; };
layout(std140, binding = SOLID_PARAMS) uniform Params { SolidParams params; };
#ifdef SOLID_VOTE
layout(std430, binding = SOLID_VOLUME_X) readonly buffer VolumeX { uint volume_x[]; };
layout(std430, binding = SOLID_VOLUME_Y) readonly buffer VolumeY { uint volume_y[]; };
layout(std430, binding = SOLID_DISAGREE) buffer Disagree { uint disagree[]; };
#endif

const uint kRuns = 32768u;        // invocations of a tile
const uint kBlockWords = 8192u;   // words of a block of 64^3 cells

// Spreads to every third bit.
uint spread_bits(uint v) {
  v = (v | (v << 8)) & 0x00f00fu;
  v = (v | (v << 4)) & 0x0c30c3u;
  return (v | (v << 2)) & 0x249249u;
}

// Bits of a word of 4x4x2 cells: x0 y0 z0 x1 y1.
uint place_x(int x) { return uint((x & 1) | ((x & 2) << 2)); }
uint place_y(int y) { return uint(((y & 1) << 1) | ((y & 2) << 3)); }

// Removes cells outside the grid.
uint grid_cells(ivec3 base) {
  ivec3 left = params.cells.xyz - base;
  if (all(greaterThanEqual(left, ivec3(4, 4, 2)))) return ~0u;
  uint cells = 0u;
  for (int n = 0; n < 32; ++n) {
    ivec3 at = ivec3((n & 1) | ((n >> 2) & 2), ((n >> 1) & 1) | ((n >> 3) & 2), (n >> 2) & 1);
    if (all(lessThan(at, left))) cells |= 1u << n;
  }
  return cells;
}

uint cells_along_z(ivec3 base) {
  uint cells = 0u;
  int at = (base.z >> 5) * SOLID_TILE_COLUMNS + base.y * SOLID_TILE_CELLS + base.x;
  for (int n = 0; n < 16; ++n) {
    int x = n & 3, y = n >> 2;
    uint bits = volume_z[at + y * SOLID_TILE_CELLS + x] >> (base.z & 31);
    cells |= ((bits & 1u) | ((bits & 2u) << 3)) << (place_x(x) + place_y(y));
  }
  return cells;
}

#ifdef SOLID_VOTE
// u is y, v is z.
uint cells_along_x(ivec3 base) {
  uint cells = 0u;
  int at = (base.x >> 5) * SOLID_TILE_COLUMNS + base.z * SOLID_TILE_CELLS + base.y;
  for (int n = 0; n < 8; ++n) {
    int y = n & 3, z = n >> 2;
    uint bits = volume_x[at + z * SOLID_TILE_CELLS + y] >> (base.x & 31);
    cells |= ((bits & 3u) | ((bits & 12u) << 6)) << (place_y(y) + uint(z << 2));
  }
  return cells;
}

// u is z, v is x.
uint cells_along_y(ivec3 base) {
  uint cells = 0u;
  int at = (base.y >> 5) * SOLID_TILE_COLUMNS + base.x * SOLID_TILE_CELLS + base.z;
  for (int n = 0; n < 8; ++n) {
    int x = n & 3, z = n >> 2;
    uint bits = volume_y[at + x * SOLID_TILE_CELLS + z] >> (base.y & 31);
    bits = (bits & 1u) | ((bits & 2u) << 1) | ((bits & 4u) << 14) | ((bits & 8u) << 15);
    cells |= bits << (place_x(x) + uint(z << 2));
  }
  return cells;
}
#endif

// Sets flags. Most words set flags that are already set, so a read saves the atomic.
void note(uint flag, uint cells) {
  uint news = (cells != 0u ? 1u : 0u) | (cells != ~0u ? 2u : 0u);
  if ((flags[flag] & news) != news) atomicOr(flags[flag], news);
}

// State of 32 cells of 4x4 columns along z: 0: all outside, 1: all inside, 2: mixed.
int uniform_along_z(ivec3 base) {
  int at = (base.z >> 5) * SOLID_TILE_COLUMNS + base.y * SOLID_TILE_CELLS + base.x;
  uint any = 0u, all = ~0u;
  for (int n = 0; n < 16; ++n) {
    uint bits = volume_z[at + (n >> 2) * SOLID_TILE_CELLS + (n & 3)];
    any |= bits;
    all &= bits;
  }
  return any == 0u ? 0 : (all == ~0u ? 1 : 2);
}

void make_word(ivec3 base, int state) {
  uint word = (spread_bits(uint(base.x)) | (spread_bits(uint(base.y)) << 1) |
               (spread_bits(uint(base.z)) << 2)) >>
              5;
  uint block = word / kBlockWords;
  uint in_grid = grid_cells(base);
  uint cells = state == 2 ? cells_along_z(base) : 0u - uint(state);
  cells &= in_grid;
#ifdef SOLID_VOTE
  uint x = in_grid == 0u ? 0u : cells_along_x(base) & in_grid;
  uint y = in_grid == 0u ? 0u : cells_along_y(base) & in_grid;
  uint some = x | y | cells;
  uint doubtful = some & ~(x & y & cells);
  cells = (cells & (x | y)) | (x & y);
  disagree[word] = doubtful;
  note(uint(SOLID_FLAG_DISAGREE) + block, doubtful);
  if (some != 0u) atomicAdd(flags[uint(SOLID_FLAG_INSIDE) + block], uint(bitCount(some)));
#endif
  mask[word] = cells;
  note(uint(SOLID_FLAG_CELLS) + block, cells);
}

void main() {
  uint group = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
  uint index = group * uint(SOLID_GROUP_SIZE) + gl_LocalInvocationIndex;
  if (index >= kRuns) return;
  ivec3 base = ivec3(index & 63u, (index >> 6) & 63u, index >> 12) * ivec3(4, 4, 32);
  int state = any(greaterThanEqual(base, params.cells.xyz)) ? 0 : uniform_along_z(base);
  for (int pair = 0; pair < 16; ++pair) make_word(base + ivec3(0, 0, 2 * pair), state);
}
