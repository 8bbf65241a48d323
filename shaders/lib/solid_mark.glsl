// Marking of a crossing in the volume of a tile, or of a slab of it. The including file has
// `params`. Parity: the bit of the first cell above flips. SOLID_COUNT: the count of that cell
// changes by the sign, and its bit says that it has one.
layout(std430, binding = SOLID_VOLUME) buffer Volume { uint volume[]; };
#ifdef SOLID_COUNT
layout(std430, binding = SOLID_COUNTS) buffer Counts { int counts[]; };
#endif

void mark_crossing(int u, int v, int cell, int winding) {
  if (cell < params.cell_first && params.is_lowest != 0) cell = params.cell_first;
  if (cell < params.cell_first || cell > params.cell_last) return;
  int column = v * SOLID_TILE_CELLS + u;
#ifdef SOLID_COUNT
  atomicAdd(counts[(cell & 31) * SOLID_TILE_COLUMNS + column], winding);
  atomicOr(volume[(cell >> 5) * SOLID_TILE_COLUMNS + column], 1u << (cell & 31));
#else
  atomicXor(volume[(cell >> 5) * SOLID_TILE_COLUMNS + column], 1u << (cell & 31));
#endif
}
