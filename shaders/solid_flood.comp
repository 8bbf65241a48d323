// One step of sign=flood: extends the reached cells along one axis, both ways, through all free
// cells of a row. Bits run along x: cell (x, y, z) is bit x & 31 of word (z * cells.y + y) *
// words_x + x / 32. Bits beyond the grid's end in x are free. Steps along x, y and z alternate
// until none changes anything.
#include "shared/solid.h"

layout(local_size_x = SOLID_GROUP_SIZE) in;
layout(std430, binding = SOLID_FREE) readonly buffer Free { uint free_cells[]; };
layout(std430, binding = SOLID_REACHED) buffer Reached { uint reached[]; };
layout(std430, binding = SOLID_CHANGED) buffer Changed { uint changed; };
layout(std140, binding = SOLID_PARAMS) uniform Params { FloodParams params; };

bool has_changed = false;

void reach(int word, uint cells) {
  if (reached[word] == cells) return;
  reached[word] = cells;
  has_changed = true;
}

// Extends bits up, or down, through free ones by 1, 2, 4, ... at a time (Kogge & Stone 1973).
uint spread_up(uint cells, uint through) {
  for (int shift = 1; shift < 32; shift *= 2) {
    cells |= through & (cells << shift);
    through &= through << shift;
  }
  return cells;
}
uint spread_down(uint cells, uint through) {
  for (int shift = 1; shift < 32; shift *= 2) {
    cells |= through & (cells >> shift);
    through &= through >> shift;
  }
  return cells;
}

void flood_row(int first) {
  uint carry = 1u;  // the outside
  for (int word = first; word < first + params.words_x; ++word) {
    uint through = free_cells[word];
    uint cells = spread_up(reached[word] | (carry & through), through);
    reach(word, cells);
    carry = cells >> 31;
  }
  carry = 1u;
  for (int word = first + params.words_x - 1; word >= first; --word) {
    uint through = free_cells[word];
    uint cells = spread_down(reached[word] | ((carry << 31) & through), through);
    reach(word, cells);
    carry = cells & 1u;
  }
}

// Floods `count` words that are `step` apart.
void flood_line(int first, int step, int count) {
  uint carry = ~0u;
  for (int n = 0; n < count; ++n) {
    int word = first + n * step;
    carry = reached[word] | (carry & free_cells[word]);
    reach(word, carry);
  }
  carry = ~0u;
  for (int n = count - 1; n >= 0; --n) {
    int word = first + n * step;
    carry = reached[word] | (carry & free_cells[word]);
    reach(word, carry);
  }
}

void main() {
  uint group = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
  uint index = group * uint(SOLID_GROUP_SIZE) + gl_LocalInvocationIndex;
  if (index >= params.lines) return;
  int line = int(index);
  int plane = params.words_x * params.cells.y;
  if (params.axis == 0) {
    flood_row(line * params.words_x);
  } else if (params.axis == 1) {
    flood_line(line / params.words_x * plane + line % params.words_x, params.words_x,
               params.cells.y);
  } else {
    flood_line(line, plane, params.cells.z);
  }
  if (has_changed && changed == 0u) atomicOr(changed, 1u);
}
