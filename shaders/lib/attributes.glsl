// A triangle's shares in the cells that it touches: the area of its intersection with a cell, and
// the weights of its corners at points of it. All are integers. server/voxel/README.md defines each
// number; tests/unit/voxel compiles this file as C++.
//
// Positions are relative to the tile and swizzled, as in lib/touch.glsl. Clipping is in
// lib/attribute_polygon.glsl, which must come before this file.

// Twice an area, 1/32 of a cell's face. Smaller triangles get a single tap.
#define TAP_TWICE_AREA_MIN (1u << 20)

struct AttributeTriangle {
  // (a, b) of a side: a X + b Y + rest >= 0 inside; X and Y in 1/512 of a cell
  ivec2 edge0, edge1, edge2;
  int64_t edge_rest0, edge_rest1, edge_rest2;
  int slope_i, slope_j;        // 2^-24 cells per column
  int64_t depth;               // depth of the plane at the corner of column (0, 0), 2^-24 cells
  ivec2 form1, form2;          // linear forms of corner 1's and corner 2's weight
  int64_t rest1, rest2;        // their constants, in 1/512 of a cell
  int64_t limit;               // the value at which a form gives weight 1
  int64_t reciprocal;          // floor(2^58 / limit)
  ivec2 box_min, box_max;      // box of the projection, 1/512 of a cell
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

// Areas are measured half a sub-voxel below the corners on each axis. Surfaces that begin and end
// on boundaries between cells then fill whole cells.
int64_t edge_rest(ivec2 edge, ivec3 from) {
  return -(int64_t(edge.x) * int64_t(2 * from.x) + int64_t(edge.y) * int64_t(2 * from.y));
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
  t.edge0 = ivec2(-d0.y * side, d0.x * side);
  t.edge1 = ivec2(-d1.y * side, d1.x * side);
  t.edge2 = ivec2(-d2.y * side, d2.x * side);
  t.edge_rest0 = edge_rest(t.edge0, v0);
  t.edge_rest1 = edge_rest(t.edge1, v1);
  t.edge_rest2 = edge_rest(t.edge2, v2);
  t.slope_i = slope_i;
  t.slope_j = slope_j;
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
  t.factor = flags & uint(ATTRIBUTE_FACTOR_MASK);
  return t;
}

// A side as a line of a column's polygon: value >= 0 inside, x and y in 2^-12 cells from the
// column's corner. Coefficients get 15 bits, which errs by half a unit across a column. The
// constant is clamped to the range beyond which no point of the column changes its sign.
ivec3 column_line(ivec2 edge, int64_t rest, int i, int j) {
  int shift = max(findMSB(uint(max(abs(edge.x), abs(edge.y)))) - 14, 0);
  int64_t corner = int64_t(edge.x) * int64_t(512 * i) + int64_t(edge.y) * int64_t(512 * j) + rest;
  int64_t limit = int64_t(1 << 29);
  return ivec3(edge.x >> shift, edge.y >> shift,
               int(clamp64((corner * int64_t(8)) >> shift, -limit, limit)));
}

// The intersection of the triangle's projection with column (i, j).
CellPolygon column_polygon(AttributeTriangle t, int i, int j) {
  CellPolygon polygon = whole_column();
  if (t.factor == 0u) polygon.count = 0;
  polygon = clip_polygon(polygon, column_line(t.edge0, t.edge_rest0, i, j));
  polygon = clip_polygon(polygon, column_line(t.edge1, t.edge_rest1, i, j));
  return clip_polygon(polygon, column_line(t.edge2, t.edge_rest2, i, j));
}

int64_t column_depth_at(AttributeTriangle t, int i, int j) {
  return t.depth + int64_t(t.slope_i) * int64_t(i) + int64_t(t.slope_j) * int64_t(j);
}

// The part of a column's polygon that lies in cell k. The triangle must touch the cell, so the
// plane is within 5 cells of it everywhere in the column. depth: column_depth_at().
CellPolygon cell_polygon(AttributeTriangle t, CellPolygon column, int64_t depth, int k) {
  if (column.count == 0) return column;
  int rise = int(depth - (int64_t(k) << ATTRIBUTE_DEPTH_BITS));
  int a = t.slope_i >> 9, b = t.slope_j >> 9, c = (rise >> 9) * 4096;
  CellPolygon above = clip_polygon(column, ivec3(a, b, c));
  return clip_polygon(above, ivec3(-a, -b, 4096 * (1 << (ATTRIBUTE_DEPTH_BITS - 9)) - 1 - c));
}

// The weight of a triangle's intersection with a cell; a cell's face has 4096. It is at least 1, so
// that every occupied cell has a colour.
uint area_weight(AttributeTriangle t, uint twice_area) {
  return max((((twice_area + 16u) >> 5) * t.factor + (1u << 15)) >> 16, 1u);
}

// Converts a point of a column's polygon, in 2^-12 cells from the column's corner, to 1/512 of a
// cell.
ivec2 position_in_column(int i, int j, ivec2 point) {
  return ivec2(512 * i + 1, 512 * j + 1) + ((point + 4) >> 3);
}

// The position at which attributes are sampled, in 1/512 of a cell. It is the polygon's centroid,
// or, without area, the column's centre clamped to the triangle's box.
ivec2 sample_position(AttributeTriangle t, int i, int j, CellPolygon polygon, uint twice_area) {
  if (twice_area == 0u) {
    return clamp(ivec2(512 * i + 256, 512 * j + 256), t.box_min, t.box_max);
  }
  return position_in_column(i, j, polygon_centroid(polygon, twice_area));
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

// Weights at the centroid of a triangle whose corners have these weights.
ivec3 centre_weights(ivec3 a, ivec3 b, ivec3 c) {
  int w1 = int(uint(a.y + b.y + c.y) / 3u), w2 = int(uint(a.z + b.z + c.z) / 3u);
  return ivec3((1 << ATTRIBUTE_WEIGHT_BITS) - w1 - w2, w1, w2);
}

// Weights half way between two points. Half way from a triangle's centroid to a corner is the
// centroid of the quarter at that corner. The fourth quarter has the triangle's own centroid.
ivec3 middle_weights(ivec3 a, ivec3 b) {
  int w1 = (a.y + b.y) >> 1, w2 = (a.z + b.z) >> 1;
  return ivec3((1 << ATTRIBUTE_WEIGHT_BITS) - w1 - w2, w1, w2);
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

// A part's share of a polygon's area; 2^15 is all of it.
uint area_share(uint twice_part, uint twice_area) {
  int shift = max(findMSB(twice_area) - 15, 0);
  return ((twice_part >> shift) << 15) / (twice_area >> shift);
}

// The level whose texels are as large as a part of a cell. level_max is the level whose texels are
// as large as the cell. twice_area: the part's, 2^25 for a cell's face.
int part_level(uint twice_area, int level_max) {
  return max(level_max - ((25 - findMSB(twice_area)) >> 1), 0);
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
