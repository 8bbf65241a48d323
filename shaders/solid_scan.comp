// Converts crossings to cells, one column per invocation: a prefix XOR over the bits of the
// column's words, starting with the state below the tile, which is carried to the next tile. (In
// Eisemann & Decoret 2008 fragments flip whole columns instead.) SOLID_SLICES: also XORs the cells
// of the slice map, which fragments flipped. SOLID_COUNT: a slab of sums of signs becomes one word
// of each column. Its cells are those whose sum is not 0 (SOLID_NONZERO), or is at least their
// threshold.
#include "shared/solid.h"

layout(local_size_x = SOLID_GROUP_SIZE) in;
layout(std430, binding = SOLID_VOLUME) buffer Volume { uint volume[]; };
layout(std140, binding = SOLID_PARAMS) uniform Params { SolidParams params; };
#ifdef SOLID_COUNT
layout(std430, binding = SOLID_CARRIES) buffer Carries { int carries[]; };
layout(std430, binding = SOLID_COUNTS) buffer Counts { int counts[]; };
layout(std430, binding = SOLID_THRESHOLDS) readonly buffer Thresholds { int thresholds[]; };

bool is_inside(int sum, int threshold) {
#ifdef SOLID_NONZERO
  return sum != 0;
#else
  return sum >= threshold;
#endif
}

// The threshold of 8 cells of the column; SOLID_MIXED and more if they differ.
int brick_threshold(int column, int brick) {
  return params.has_thresholds == 0
             ? 1
             : thresholds[(brick * 32 + (column >> 11)) * 32 + ((column & 255) >> 3)];
}

int cell_threshold(int mixed, int column, int cell) {
  return thresholds[SOLID_SLAB_BRICKS + (mixed - SOLID_MIXED) * 512 +
                    ((cell & 7) * 8 + ((column >> 8) & 7)) * 8 + (column & 7)];
}

void scan_column(int column) {
  int sum = carries[column];
  uint word = params.slab * uint(SOLID_TILE_COLUMNS) + uint(column);
  uint changed = volume[word];
  uint bits = 0u;
  for (int brick = 0; brick < SOLID_SLAB_CELLS / 8; ++brick) {
    int threshold = brick_threshold(column, brick);
    uint changes = (changed >> (8 * brick)) & 255u;
    if (changes == 0u && threshold < SOLID_MIXED) {
      if (is_inside(sum, threshold)) bits |= 255u << (8 * brick);
      continue;
    }
    for (int cell = 8 * brick; cell < 8 * brick + 8; ++cell) {
      if (((changed >> cell) & 1u) != 0u) {
        int at = cell * SOLID_TILE_COLUMNS + column;
        sum += counts[at];
        counts[at] = 0;  // for the next slab
      }
      int one = threshold < SOLID_MIXED ? threshold : cell_threshold(threshold, column, cell);
      if (is_inside(sum, one)) bits |= 1u << cell;
    }
  }
  carries[column] = sum;
  volume[word] = bits;
}
#else
layout(std430, binding = SOLID_CARRIES) buffer Carries { uint carries[]; };
#ifdef SOLID_SLICES
layout(binding = SOLID_SLICES_LOW) uniform usampler2D slices_low;
layout(binding = SOLID_SLICES_HIGH) uniform usampler2D slices_high;
#endif

void scan_column(int column) {
  uint place = params.carry_slot * uint(SOLID_CARRY_WORDS) + uint(column >> 5);
  uint below = (carries[place] >> (column & 31)) & 1u;
  uint state = 0u - below;
#ifdef SOLID_SLICES
  ivec2 at = ivec2(column & 255, column >> 8);
  uvec4 low = texelFetch(slices_low, at, 0);
  uvec4 high = texelFetch(slices_high, at, 0);
  uint slices[SOLID_COLUMN_WORDS] =
      uint[](low.x, low.y, low.z, low.w, high.x, high.y, high.z, high.w);
#endif
  for (int word = 0; word < SOLID_COLUMN_WORDS; ++word) {
    int at_word = word * SOLID_TILE_COLUMNS + column;
    uint bits = volume[at_word];
    bits ^= bits << 1;
    bits ^= bits << 2;
    bits ^= bits << 4;
    bits ^= bits << 8;
    bits ^= bits << 16;
    bits ^= state;
    state = 0u - (bits >> 31);
#ifdef SOLID_SLICES
    bits ^= slices[word];
#endif
    volume[at_word] = bits;
  }
#ifdef SOLID_SLICES
  state ^= 0u - (slices[SOLID_COLUMN_WORDS - 1] >> 31);
#endif
  // An atomic, because other invocations own the word's other bits.
  if ((state & 1u) != below) atomicXor(carries[place], 1u << (column & 31));
}
#endif

void main() {
  uint group = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
  uint column = group * uint(SOLID_GROUP_SIZE) + gl_LocalInvocationIndex;
  if (column < uint(SOLID_TILE_COLUMNS)) scan_column(int(column));
}
