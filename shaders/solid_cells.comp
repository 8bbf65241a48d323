// The bits of columns become a tile's mask in Morton order, a word of 4x4x2 cells for each
// invocation. SOLID_VOTE: two of three axes, and the cells on which they disagree. SOLID_MIX: where
// they do, the cells of SOLID_VOLUME_Z instead.
#include "shared/solid.h"

layout(local_size_x = SOLID_GROUP_SIZE) in;
layout(std430, binding = SOLID_VOLUME_Z) readonly buffer VolumeZ { uint volume_z[]; };
layout(std430, binding = SOLID_MASK) buffer Mask { uint mask[]; };
layout(std430, binding = SOLID_FLAGS) buffer Flags { uint flags[]; };
layout(std140, binding = SOLID_PARAMS) uniform Params { SolidParams params; };
#ifdef SOLID_VOTE
layout(std430, binding = SOLID_VOLUME_X) readonly buffer VolumeX { uint volume_x[]; };
layout(std430, binding = SOLID_VOLUME_Y) readonly buffer VolumeY { uint volume_y[]; };
#endif
#if defined(SOLID_VOTE) || defined(SOLID_MIX)
layout(std430, binding = SOLID_DISAGREE) buffer Disagree { uint disagree[]; };
#endif

const uint kWords = 524288u;      // of the mask
const uint kBlockWords = 8192u;   // of 64^3 cells

// Every third bit.
uint compact_bits(uint v) {
  v &= 0x249249u;
  v = (v | (v >> 2)) & 0x0c30c3u;
  v = (v | (v >> 4)) & 0x00f00fu;
  return (v | (v >> 8)) & 0x0000ffu;
}

// Bits of a word of 4x4x2 cells: x0 y0 z0 x1 y1.
uint place_x(int x) { return uint((x & 1) | ((x & 2) << 2)); }
uint place_y(int y) { return uint(((y & 1) << 1) | ((y & 2) << 3)); }

// Cells beyond the grid are not inside.
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

// Most words say what others have said already.
void note(uint flag, uint cells) {
  uint news = (cells != 0u ? 1u : 0u) | (cells != ~0u ? 2u : 0u);
  if ((flags[flag] & news) != news) atomicOr(flags[flag], news);
}

void main() {
  uint group = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
  uint word = group * uint(SOLID_GROUP_SIZE) + gl_LocalInvocationIndex;
  if (word >= kWords) return;
  uint code = word << 5;
  ivec3 base = ivec3(compact_bits(code), compact_bits(code >> 1), compact_bits(code >> 2));
  uint block = word / kBlockWords;
#ifdef SOLID_MIX
  uint doubtful = disagree[word];
  uint cells = mask[word];
  if (doubtful != 0u) {
    cells = (cells & ~doubtful) | (cells_along_z(base) & doubtful);
    mask[word] = cells;
  }
#else
  uint in_grid = grid_cells(base);
  uint cells = in_grid == 0u ? 0u : cells_along_z(base) & in_grid;
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
#endif
  note(uint(SOLID_FLAG_CELLS) + block, cells);
}
