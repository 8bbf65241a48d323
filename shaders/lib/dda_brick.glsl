// Place of a voxel in the 512-bit mask of its brick: Morton order, x lowest (proto/sparse_tile.h).
// Integers alone; compiled into a C++ test as well.

int dda_spread_3bit(int v) { return (v & 1) | ((v & 2) << 2) | ((v & 4) << 4); }

// 0..511; the low 3 bits of each coordinate count.
int dda_brick_bit(int x, int y, int z) {
  return dda_spread_3bit(x) | (dda_spread_3bit(y) << 1) | (dda_spread_3bit(z) << 2);
}
