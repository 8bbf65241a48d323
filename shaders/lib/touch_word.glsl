// The 4x4x2 cells of one mask word that a small triangle touches, all 32 at once by sums and signs.
// There are no branches, and no loops over touched cells, in which the lanes of a SIMD group would
// diverge. lib/touch.glsl explains the sums; its TOUCH_INT is int here.
//
// Cell (x, y, z) of the word is bit x0 + 2 y0 + 4 z0 + 8 x1 + 16 y1 (lib/touch_mask.glsl), x0 the
// lowest digit of x. Cells may lie up to 3 outside the triangle's own 17 (1 along z), so heights
// stay below 2^24 * (19 + 19 + 17 + 6) < 2^30 in size.

// The place of the cell's bit in the word.
int word_place(int x, int y, int z) {
  return (x & 1) + 2 * (y & 1) + 4 * z + 8 * (x >> 1) + 16 * (y >> 1);
}

// Returns `bits` if one of the numbers is negative, else 0.
uint word_negative(ivec3 v, uint bits) { return uint((v.x | v.y | v.z) >> 31) & bits; }
uint word_outside(int at, int first, int last, uint bits) {
  return uint(((at - first) | (last - at)) >> 31) & bits;
}

// Cells outside the box.
uint word_beyond_box(TouchTriangle t, ivec3 cell) {
  uint bits = 0u;
  for (int i = 0; i < 4; ++i) {
    bits |= word_outside(cell.x + i, t.cell_min.x, t.cell_max.x, 0x550055u << word_place(i, 0, 0));
    bits |= word_outside(cell.y + i, t.cell_min.y, t.cell_max.y, 0x3333u << word_place(0, i, 0));
  }
  for (int k = 0; k < 2; ++k) {
    bits |= word_outside(cell.z + k, t.cell_min.z, t.cell_max.z, 0xf0f0f0fu << word_place(0, 0, k));
  }
  return bits;
}

// Cells whose projection along one axis is beyond an edge. The three edges are handled as a vector.
uint word_beside_xy(TouchTriangle t, ivec3 cell) {
  ivec3 a = ivec3(t.xy0.x, t.xy1.x, t.xy2.x);
  ivec3 b = ivec3(t.xy0.y, t.xy1.y, t.xy2.y);
  ivec3 row = a * cell.x + b * cell.y + ivec3(t.xy0.z, t.xy1.z, t.xy2.z);
  uint bits = 0u;
  for (int y = 0; y < 4; ++y) {
    ivec3 at = row;
    for (int x = 0; x < 4; ++x) {
      bits |= word_negative(at, 0x11u << word_place(x, y, 0));
      at += a;
    }
    row += b;
  }
  return bits;
}
uint word_beside_yz(TouchTriangle t, ivec3 cell) {
  ivec3 a = ivec3(t.yz0.x, t.yz1.x, t.yz2.x);
  ivec3 b = ivec3(t.yz0.y, t.yz1.y, t.yz2.y);
  ivec3 row = a * cell.y + b * cell.z + ivec3(t.yz0.z, t.yz1.z, t.yz2.z);
  uint bits = 0u;
  for (int z = 0; z < 2; ++z) {
    ivec3 at = row;
    for (int y = 0; y < 4; ++y) {
      bits |= word_negative(at, 0x303u << word_place(0, y, z));
      at += a;
    }
    row += b;
  }
  return bits;
}
uint word_beside_zx(TouchTriangle t, ivec3 cell) {
  ivec3 a = ivec3(t.zx0.x, t.zx1.x, t.zx2.x);
  ivec3 b = ivec3(t.zx0.y, t.zx1.y, t.zx2.y);
  ivec3 row = a * cell.z + b * cell.x + ivec3(t.zx0.z, t.zx1.z, t.zx2.z);
  uint bits = 0u;
  for (int x = 0; x < 4; ++x) {
    ivec3 at = row;
    for (int z = 0; z < 2; ++z) {
      bits |= word_negative(at, 0x50005u << word_place(x, 0, z));
      at += a;
    }
    row += b;
  }
  return bits;
}

// Cells above or below the plane.
uint word_off_plane(TouchTriangle t, ivec3 cell) {
  int span = t.above + t.below;
  int layer = t.normal.x * cell.x + t.normal.y * cell.y + t.normal.z * (cell.z - t.base_z) +
              t.plane + t.above;
  uint bits = 0u;
  for (int z = 0; z < 2; ++z) {
    int row = layer;
    for (int y = 0; y < 4; ++y) {
      int at = row;
      for (int x = 0; x < 4; ++x) {
        bits |= uint((at | (span - at)) >> 31) & (1u << word_place(x, y, z));
        at += t.normal.x;
      }
      row += t.normal.y;
    }
    layer += t.normal.z;
  }
  return bits;
}

// The touched cells of the word whose first cell is `cell`, in the coordinates of the triangle's
// setup, unswizzled.
uint touch_word(TouchTriangle t, ivec3 cell) {
  return ~(word_beyond_box(t, cell) | word_beside_xy(t, cell) | word_beside_yz(t, cell) |
           word_beside_zx(t, cell) | word_off_plane(t, cell));
}
