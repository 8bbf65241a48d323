// The bits of a tile: cell (x, y, z), 0..255 each, is bit m & 31 of word m >> 5, m its Morton code
// (proto/codec/sparse_tile.h: bricks in Morton order, and Morton order within the brick).

#define TILE_MORTON_X 0x249249u

// Spreads the low 8 bits to every third bit.
uint tile_spread(uint v) {
  v = (v | (v << 8)) & 0x00f00fu;
  v = (v | (v << 4)) & 0x0c30c3u;
  return (v | (v << 2)) & TILE_MORTON_X;
}

// Morton code of swizzled cell (i, j, k). Its z is axis 0, 1 or 2 of the tile.
uint tile_morton(int i, int j, int k, int axis) {
  uint x = tile_spread(uint(i)), y = tile_spread(uint(j)), z = tile_spread(uint(k));
  return axis == 2 ? (x | (y << 1) | (z << 2))
                   : (axis == 0 ? ((x << 1) | (y << 2) | z) : ((x << 2) | y | (z << 1)));
}
