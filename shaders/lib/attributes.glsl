// What a triangle gives to the cells that it touches: how much of it lies in a cell, by a lattice
// of 4 x 4 points per column, and the weights of its corners there. All in integers;
// server/voxel/README.md defines each number, tests/unit/voxel compiles this file as C++.
//
// Positions are relative to the tile and swizzled, as in lib/touch.glsl. Lattice point (m, n) of
// column (i, j) lies (2m+1)/8, (2n+1)/8 of a cell from the column's corner.

// a*I + b*J at the far end of a tile, 1023 lattice steps, for the longest side of 2050 cells is at
// most 1,073,740,800; so a constant that is clamped to this keeps its sign and its sum in 32 bits.
#define LATTICE_CLAMP 1073742000

struct AttributeTriangle {
  // (a, b, c): a lattice point is inside iff a*I + b*J + c >= 0 for all
  ivec3 edge0, edge1, edge2;
  int slope_i, slope_j;        // 2^-24 cells per column
  int64_t depth;               // of the plane at the corner of column (0, 0), 2^-24 cells
  ivec2 form1, form2;          // linear forms of corner 1's and corner 2's weight
  int64_t rest1, rest2;        // their constants, in 1/512 of a cell
  int64_t limit;               // where a form gives weight 1
  int64_t reciprocal;          // floor(2^58 / limit)
  ivec2 box_min, box_max;      // of the projection, 1/64 of a cell
  uint factor;                 // of area: 256 |n| / |n_dominant|
};

// Not the built-in: with 64-bit constants it crashes the compiler of Mesa 22.3.6.
int64_t clamp64(int64_t value, int64_t low, int64_t high) {
  if (value < low) return low;
  return value > high ? high : value;
}

// Lattice edge of the side from (x, y) along (dx, dy). Points on a side belong to one of the two
// triangles that share it: to the one for which (a, b) is lexicographically positive.
ivec3 lattice_edge(int x, int y, int dx, int dy, int side) {
  int a = -dy * side;
  int b = dx * side;
  int64_t rest = int64_t(a) * int64_t(63 - 2 * x) + int64_t(b) * int64_t(63 - 2 * y);
  if (!(a > 0 || (a == 0 && b > 0))) rest -= int64_t(1);
  rest = clamp64(rest >> 7, int64_t(-LATTICE_CLAMP), int64_t(LATTICE_CLAMP));
  return ivec3(a, b, int(rest));
}

int64_t form_rest(ivec2 form, ivec3 from) {
  return -(int64_t(form.x) * int64_t(2 * from.x + 1) + int64_t(form.y) * int64_t(2 * from.y + 1));
}

// v: corners; flags, slopes and reciprocal: the triangle's words of shared/attributes.h.
AttributeTriangle attribute_setup(ivec3 v0, ivec3 v1, ivec3 v2, int slope_i, int slope_j,
                                  int64_t reciprocal, uint flags) {
  AttributeTriangle t;
  ivec3 d0 = v1 - v0;
  ivec3 d1 = v2 - v1;
  ivec3 d2 = v0 - v2;
  int64_t area = int64_t(d0.x) * int64_t(d1.y) - int64_t(d0.y) * int64_t(d1.x);
  int side = area >= int64_t(0) ? 1 : -1;
  t.edge0 = lattice_edge(v0.x, v0.y, d0.x, d0.y, side);
  t.edge1 = lattice_edge(v1.x, v1.y, d1.x, d1.y, side);
  t.edge2 = lattice_edge(v2.x, v2.y, d2.x, d2.y, side);
  t.slope_i = slope_i;
  t.slope_j = slope_j;
  // From corner 0 at (q + 1/2) / 256 to the corner of its column, then to column (0, 0).
  t.depth = (int64_t(2 * v0.z + 1) << (ATTRIBUTE_DEPTH_BITS - 9)) -
            ((int64_t(slope_i) * int64_t(2 * (v0.x & 255) + 1) +
              int64_t(slope_j) * int64_t(2 * (v0.y & 255) + 1)) >>
             9) -
            int64_t(slope_i) * int64_t(v0.x >> 8) - int64_t(slope_j) * int64_t(v0.y >> 8);
  uint form = (flags >> ATTRIBUTE_FORM_SHIFT) & 3u;
  ivec3 from1 = v2;
  ivec3 from2 = v0;
  t.form1 = ivec2(-d2.y * side, d2.x * side);
  t.form2 = ivec2(-d0.y * side, d0.x * side);
  ivec2 along = ivec2(0, 0);
  if (form == uint(ATTRIBUTE_FORM_01)) {
    along = ivec2(d0.x, d0.y);
    from1 = v0;
    t.form1 = along;
    t.form2 = ivec2(0, 0);
  } else if (form == uint(ATTRIBUTE_FORM_02)) {
    along = ivec2(-d2.x, -d2.y);
    t.form1 = ivec2(0, 0);
    t.form2 = along;
  } else if (form == uint(ATTRIBUTE_FORM_12)) {
    along = ivec2(d1.x, d1.y);
    from2 = v1;
    t.form1 = ivec2(-along.x, -along.y);
    t.form2 = along;
  }
  t.rest1 = form_rest(t.form1, from1);
  t.rest2 = form_rest(t.form2, from2);
  int64_t measure = form == uint(ATTRIBUTE_FORM_AREA)
                        ? abs(area)
                        : int64_t(along.x) * int64_t(along.x) +
                              int64_t(along.y) * int64_t(along.y);
  t.limit = measure * int64_t(2);
  t.reciprocal = reciprocal;
  ivec3 low = min(v0, min(v1, v2));
  ivec3 high = max(v0, max(v1, v2));
  t.box_min = ivec2(low.x >> 2, low.y >> 2);
  t.box_max = ivec2(high.x >> 2, high.y >> 2);
  t.factor = flags & uint(ATTRIBUTE_FACTOR_MASK);
  return t;
}

// Bit 0 of the results: 1 where s >= 0.
uint lattice_row(int s, int step, int base) {
  return ((uint(~s) >> 31) | ((uint(~(s + step)) >> 31) << 1) |
          ((uint(~(s + 2 * step)) >> 31) << 2) | ((uint(~(s + 3 * step)) >> 31) << 3))
         << base;
}
uint lattice_side(ivec3 edge, int i, int j) {
  int s = edge.x * (4 * i) + edge.y * (4 * j) + edge.z;
  return lattice_row(s, edge.x, 0) | lattice_row(s + edge.y, edge.x, 4) |
         lattice_row(s + 2 * edge.y, edge.x, 8) | lattice_row(s + 3 * edge.y, edge.x, 12);
}

// Lattice points of column (i, j) inside the projection of the triangle; bit m + 4 n.
uint lattice_inside(AttributeTriangle t, int i, int j) {
  if (t.factor == 0u) return 0u;
  return lattice_side(t.edge0, i, j) & lattice_side(t.edge1, i, j) & lattice_side(t.edge2, i, j);
}

int64_t lattice_depth(AttributeTriangle t, int i, int j) {
  return t.depth + int64_t(t.slope_i) * int64_t(i) + int64_t(t.slope_j) * int64_t(j);
}

// Lattice points at which the plane lies at or above the floor of a cell; rise: depth of the plane
// at the column's corner above that floor, 2^-24 cells, less than 8 cells either way.
uint lattice_above(AttributeTriangle t, int rise) {
  int s = 8 * rise + t.slope_i + t.slope_j;
  int step = 2 * t.slope_i;
  return lattice_row(s, step, 0) | lattice_row(s + 2 * t.slope_j, step, 4) |
         lattice_row(s + 4 * t.slope_j, step, 8) | lattice_row(s + 6 * t.slope_j, step, 12);
}

// Lattice points at which the plane lies in cell k. The cell is one that the triangle touches, so
// the plane is within 5 cells of it everywhere in the column.
uint lattice_in_cell(AttributeTriangle t, int64_t depth, int k) {
  int rise = int(depth - (int64_t(k) << ATTRIBUTE_DEPTH_BITS));
  return lattice_above(t, rise) & ~lattice_above(t, rise - (1 << ATTRIBUTE_DEPTH_BITS));
}

// Where attributes are taken, in 1/64 of a cell: the mean of the points, or without any the
// column's centre, moved into the triangle's box.
ivec2 sample_position(AttributeTriangle t, int i, int j, uint points) {
  if (points == 0u) {
    return clamp(ivec2(64 * i + 32, 64 * j + 32), t.box_min, t.box_max);
  }
  int count = bitCount(points);
  int m = bitCount(points & 0xaaaau) + 2 * bitCount(points & 0xccccu);
  int n = bitCount(points & 0xf0f0u) + 2 * bitCount(points & 0xff00u);
  return ivec2(64 * i + 8 + (16 * m) / count, 64 * j + 8 + (16 * n) / count);
}

int form_weight(AttributeTriangle t, ivec2 form, int64_t rest, ivec2 at) {
  int64_t value = int64_t(form.x) * int64_t(8 * at.x) + int64_t(form.y) * int64_t(8 * at.y) + rest;
  return int((clamp64(value, int64_t(0), t.limit) * t.reciprocal) >> (58 - ATTRIBUTE_WEIGHT_BITS));
}

// Weights of the three corners, sum 2^24.
ivec3 corner_weights(AttributeTriangle t, ivec2 at) {
  int one = 1 << ATTRIBUTE_WEIGHT_BITS;
  int w1 = form_weight(t, t.form1, t.rest1, at);
  int w2 = min(form_weight(t, t.form2, t.rest2, at), one - w1);
  return ivec3(one - w1 - w2, w1, w2);
}

// For 16-bit attributes: weights with 15 bits, sum 2^15, so that 65535 * 2^15 fits.
uvec3 weights15(ivec3 weights) {
  uint w1 = uint(weights.y) >> 9;
  uint w2 = uint(weights.z) >> 9;
  return uvec3(32768u - w1 - w2, w1, w2);
}

// A texture coordinate.
int blend_uv(int v0, int v1, int v2, ivec3 w) {
  return int((int64_t(v0) * int64_t(w.x) + int64_t(v1) * int64_t(w.y) +
              int64_t(v2) * int64_t(w.z)) >>
             ATTRIBUTE_WEIGHT_BITS);
}

// Product of two fractions of 65535, within 1 of it; 65535 * x = x.
uint product16(uint a, uint b) {
  uint p = a * b;
  return (p + (p >> 16) + 1u) >> 16;
}

// The coarsest level, at most level_max, of which a bilinear tap at these weights reads nothing
// beyond the triangle's sides; 0 where none is fine enough. altitude: ATTRIBUTE_ALTITUDE.
int tap_level(ivec3 weights, uint altitude, int level_max) {
  uint least = uint(min(weights.x, min(weights.y, weights.z))) >> 9;
  return min(level_max, max(findMSB((least * altitude) >> 18), 0));
}

// Points of the lattice that share a tap: 2 x 2 of them, number 0..3.
uint tap_points(uint points, int number) {
  return points & (0x33u << (2 * (number & 1) + 8 * (number >> 1)));
}

// Of a texture coordinate, in 1/256 texel from texel centre 0 of a level, within one period: from
// -128 to that of the period's end.
int level_coordinate(int uv, int size, uint wrap) {
  int one = 1 << ATTRIBUTE_UV_BITS;
  int within = wrap == uint(ATTRIBUTE_WRAP_CLAMP)    ? clamp(uv, 0, one)
               : wrap == uint(ATTRIBUTE_WRAP_REPEAT) ? uv & (one - 1)
                                                     : uv & (2 * one - 1);
  return int((int64_t(within) * int64_t(size)) >> (ATTRIBUTE_UV_BITS - 8)) - 128;
}

// Texel number of x, which is at most one beyond the period that level_coordinate() gives; `size`
// texels a side. No modulo: it would cost more than the rest of a tap.
int wrap_texel(int x, int size, uint wrap) {
  if (wrap == uint(ATTRIBUTE_WRAP_CLAMP)) return clamp(x, 0, size - 1);
  int period = wrap == uint(ATTRIBUTE_WRAP_REPEAT) ? size : 2 * size;
  int y = x < 0 ? x + period : x >= period ? x - period : x;
  return y < size ? y : period - 1 - y;
}
