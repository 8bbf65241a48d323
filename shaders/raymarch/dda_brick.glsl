// The place of a voxel in the 512-bit mask of its brick: Morton order, x lowest
// (proto/codec/sparse_tile.h). It uses only integers, so that a C++ test can compile it too.

int dda_spread_3bit(int v) { return (v & 1) | ((v & 2) << 2) | ((v & 4) << 4); }

// The place 0..511. Only the low 3 bits of each coordinate count.
int dda_brick_bit(int x, int y, int z) {
  return dda_spread_3bit(x) | (dda_spread_3bit(y) << 1) | (dda_spread_3bit(z) << 2);
}
