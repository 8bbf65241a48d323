// A triangle's shares in the cells that it touches: the area of its intersection with a cell, and
// the weights of its corners at points of it. All are integers. server/voxel/README.md defines each
// number; tests/unit/voxel compiles this file as C++.
//
// Positions are relative to the tile and swizzled, as in lib/touch.glsl. Areas are in
// lib/attribute_area.glsl, which must come before this file.

// A side of the projection: a X + b Y + rest = 0, X and Y in 1/512 of a cell. a > 0, or a = 0 and
// b >= 0, so that triangles with a common side have the same line.
struct AttributeSide {
  int a, b;
  int64_t rest;
  int shift;      // of a and b, which leaves them 15 bits
  RowLine line;
  bool is_right;  // the triangle is where the value is not negative
};

struct AttributeTriangle {
  AttributeSide side0, side1, side2;
  int slope_i, slope_j;        // 2^-24 cells per column
  int64_t depth;               // depth of the plane at the corner of column (0, 0), 2^-24 cells
  RowLine level;               // the plane at one depth
  ivec2 form1, form2;          // linear forms of corner 1's and corner 2's weight
  int64_t rest1, rest2;        // their constants, in 1/512 of a cell
  int64_t limit;               // the value at which a form gives weight 1
  int64_t reciprocal;          // floor(2^58 / limit)
  ivec2 box_min, box_max;      // box of the projection, 1/512 of a cell
  int low, high;               // the box in y where areas are measured, 2^-12 cells
  uint factor;                 // factor of the area: 256 |n| / |n_dominant|
};

// Replaces the built-in clamp, which with 64-bit constants crashes the compiler of Mesa 22.3.6.
int64_t clamp64(int64_t value, int64_t low, int64_t high) {
  if (value < low) return low;
  return value > high ? high : value;
}

int64_t form_rest(ivec2 form, ivec3 from) {
  return -(int64_t(form.x) * int64_t(2 * from.x + 1) + int64_t(form.y) * int64_t(2 * from.y + 1));
}

// The side from v along d. turn: 1 if the triangle is on its left, else -1. Areas are measured half
// a sub-voxel below the corners on each axis. Surfaces that begin and end on boundaries between
// cells then fill whole cells.
AttributeSide attribute_side(ivec3 v, ivec3 d, int turn) {
  AttributeSide side;
  int sign = d.y < 0 || (d.y == 0 && d.x >= 0) ? 1 : -1;
  side.a = -d.y * sign;
  side.b = d.x * sign;
  side.rest = -(int64_t(side.a) * int64_t(2 * v.x) + int64_t(side.b) * int64_t(2 * v.y));
  side.shift = max(findMSB(uint(max(side.a, abs(side.b)))) - 14, 0);
  side.line = row_line(side.a >> side.shift, side.b >> side.shift);
  side.is_right = sign == turn;
  return side;
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
  t.side0 = attribute_side(v0, d0, side);
  t.side1 = attribute_side(v1, d1, side);
  t.side2 = attribute_side(v2, d2, side);
  t.slope_i = slope_i;
  t.slope_j = slope_j;
  t.level = row_line(abs(slope_i) >> 9, (slope_i < 0 ? -slope_j : slope_j) >> 9);
  // Moves from corner 0 to the corner of its column, then to column (0, 0).
  t.depth = (int64_t(v0.z) << (ATTRIBUTE_DEPTH_BITS - 8)) -
            ((int64_t(slope_i) * int64_t(v0.x & 255) + int64_t(slope_j) * int64_t(v0.y & 255)) >>
             8) -
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
  t.box_min = ivec2(2 * low.x + 1, 2 * low.y + 1);
  t.box_max = ivec2(2 * high.x + 1, 2 * high.y + 1);
  t.low = 16 * low.y;
  t.high = 16 * high.y;
  t.factor = flags & uint(ATTRIBUTE_FACTOR_MASK);
  return t;
}

// The constant of a side's line in column (i, j). It is clamped to the range beyond which no point
// of the column changes its sign. Coefficients of 15 bits err by half a unit across a column.
int side_constant(AttributeSide side, int i, int j) {
  int64_t corner = int64_t(side.a) * int64_t(512 * i) + int64_t(side.b) * int64_t(512 * j) +
                   side.rest;
  int64_t limit = int64_t(1 << 29);
  return int(clamp64((corner * int64_t(8)) >> side.shift, -limit, limit));
}

ColumnRows clip_side(ColumnRows column, AttributeSide side, int i, int j) {
  return clip_rows(column, side.line, side_constant(side, i, j), side.is_right);
}

// The intersection of the triangle's projection with column (i, j).
ColumnRows triangle_rows(AttributeTriangle t, int i, int j) {
  ColumnRows column = box_rows(t.low - AREA_SIDE * j, t.high - AREA_SIDE * j);
  column = clip_side(column, t.side0, i, j);
  return clip_side(clip_side(column, t.side1, i, j), t.side2, i, j);
}

int64_t column_depth_at(AttributeTriangle t, int i, int j) {
  return t.depth + int64_t(t.slope_i) * int64_t(i) + int64_t(t.slope_j) * int64_t(j);
}

// The constant of the line at which the plane has depth k in a column. The triangle must touch cell
// k or the one below, so the plane is within 6 cells of k everywhere in the column. depth:
// column_depth_at().
int level_constant(AttributeTriangle t, int64_t depth, int k) {
  int rise = int((depth - (int64_t(k) << ATTRIBUTE_DEPTH_BITS)) >> 9);
  return (t.slope_i < 0 ? -rise : rise) * AREA_SIDE;
}

// The part of a column's rows that lies in cell k, which the triangle must touch.
CellArea cell_area(AttributeTriangle t, ColumnRows column, int64_t depth, int k) {
  CellArea cell;
  cell.low = column.low;
  cell.spacing = column.spacing;
  for (int n = 0; n < AREA_STRIPS; ++n) cell.strips[n] = no_rows();
  if (t.factor == 0u) return cell;
  // Along x the plane rises from the one constant's crossing to the other's, or falls.
  int left = level_constant(t, depth, t.slope_i < 0 ? k + 1 : k);
  int right = level_constant(t, depth, t.slope_i < 0 ? k : k + 1);
  for (int n = 0; n < AREA_STRIPS; ++n) {
    RowSums sums = no_rows();
    for (int r = n * AREA_STRIP_ROWS; r < (n + 1) * AREA_STRIP_ROWS; ++r) {
      int first = max(int(column.rows[r] & 0xffffu), row_crossing(t.level, left, row_y(column, r)));
      int last = min(int(column.rows[r] >> 16), row_crossing(t.level, right, row_y(column, r)));
      sums = add_row(sums, first, last, r);
    }
    cell.strips[n] = sums;
  }
  return cell;
}

// The weight of a triangle's intersection with a cell; a cell's face has 4096. It is at least 1, so
// that every occupied cell has a colour.
uint area_weight(AttributeTriangle t, uint area) {
  return max((area * t.factor + (1u << 10)) >> 11, 1u);
}

// Converts a point of a column, in 2^-12 cells from its corner, to 1/512 of a cell.
ivec2 position_in_column(int i, int j, ivec2 point) {
  return ivec2(512 * i + 1, 512 * j + 1) + ((point + 4) >> 3);
}

// The position at which attributes are sampled, in 1/512 of a cell. It is the centroid, or, without
// area, the column's centre clamped to the triangle's box.
ivec2 sample_position(AttributeTriangle t, int i, int j, CellArea cell, RowSums sums) {
  if (sums.lengths == 0u) {
    return clamp(ivec2(512 * i + 256, 512 * j + 256), t.box_min, t.box_max);
  }
  return position_in_column(i, j, row_centroid(cell, sums));
}

int form_weight(AttributeTriangle t, ivec2 form, int64_t rest, ivec2 at) {
  int64_t value = int64_t(form.x) * int64_t(at.x) + int64_t(form.y) * int64_t(at.y) + rest;
  return int((clamp64(value, int64_t(0), t.limit) * t.reciprocal) >> (58 - ATTRIBUTE_WEIGHT_BITS));
}

// The weights of the three corners; their sum is 2^24.
ivec3 corner_weights(AttributeTriangle t, ivec2 at) {
  int one = 1 << ATTRIBUTE_WEIGHT_BITS;
  int w1 = form_weight(t, t.form1, t.rest1, at);
  int w2 = min(form_weight(t, t.form2, t.rest2, at), one - w1);
  return ivec3(one - w1 - w2, w1, w2);
}

ivec3 weights_in_column(AttributeTriangle t, int i, int j, ivec2 point) {
  return corner_weights(t, position_in_column(i, j, point));
}

// Weights of 15 bits for 16-bit attributes. Their sum is 2^15, so that 65535 * 2^15 fits.
uvec3 weights15(ivec3 weights) {
  uint w1 = uint(weights.y) >> 9;
  uint w2 = uint(weights.z) >> 9;
  return uvec3(32768u - w1 - w2, w1, w2);
}

// Interpolates a texture coordinate.
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

// The coarsest level, at most level_max, at which a bilinear tap at these weights reads nothing
// beyond the triangle's sides. 0 if no level is fine enough. altitude: ATTRIBUTE_ALTITUDE.
int tap_level(ivec3 weights, uint altitude, int level_max) {
  uint least = uint(min(weights.x, min(weights.y, weights.z))) >> 9;
  return min(level_max, max(findMSB((least * altitude) >> 18), 0));
}

// A part's share of a length that is not 0; 2^15 is all of it.
uint length_share(uint part, uint all) { return (part << 15) / all; }

// The level whose texels are as large as a part of a cell. level_max is the level whose texels are
// as large as the cell. area: the part's.
int part_level(uint area, int level_max) {
  return max(level_max - ((AREA_FACE_BITS - findMSB(max(area, 1u))) >> 1), 0);
}

// A texture coordinate within one period of a level, in 1/256 texel from the centre of texel 0. It
// ranges from -128 to the period's end less 128.
int level_coordinate(int uv, int size, uint wrap) {
  int one = 1 << ATTRIBUTE_UV_BITS;
  int within = wrap == uint(ATTRIBUTE_WRAP_CLAMP)    ? clamp(uv, 0, one)
               : wrap == uint(ATTRIBUTE_WRAP_REPEAT) ? uv & (one - 1)
                                                     : uv & (2 * one - 1);
  return int((int64_t(within) * int64_t(size)) >> (ATTRIBUTE_UV_BITS - 8)) - 128;
}

// The number of the texel at x, which is at most one beyond the period of level_coordinate(). size:
// texels a side. A modulo would cost more than the rest of a tap.
int wrap_texel(int x, int size, uint wrap) {
  if (wrap == uint(ATTRIBUTE_WRAP_CLAMP)) return clamp(x, 0, size - 1);
  int period = wrap == uint(ATTRIBUTE_WRAP_REPEAT) ? size : 2 * size;
  int y = x < 0 ? x + period : x >= period ? x - period : x;
  return y < size ? y : period - 1 - y;
}
