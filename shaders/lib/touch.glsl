// Which cells of a tile a triangle touches, exactly: the plane test and the three 2D projections of
// Schwarz & Seidel 2010, "Fast parallel surface and solid voxelization on GPUs", in integers.
// server/voxel/README.md says what touching means; tests/unit/voxel compiles this file as C++.
//
// Vertices are integers q in 1/256 voxel and stand at q + 1/2, so that none lies on a cell's
// boundary 256 k. All is relative to the tile's min corner and swizzled: z is the triangle's
// dominant axis, and a column (i, j) is a stack of cells along it.
//
// TOUCH_INT is the integer of the plane test: int for triangles up to TOUCH_SMALL_EXTENT wide that
// reach the tile, int64_t (at most 2^51) for all others. Everything else fits int up to 2048 cells:
// an edge function is twice the area of a triangle in the grid's box, over 256.
#ifndef TOUCH_INT
#define TOUCH_INT int64_t
#define TOUCH_INT3 i64vec3
#endif
// In 1/256 voxel, on each axis. Then |normal| <= 2^20 on each axis and 3 * 511 * 2^20 < 2^31.
#define TOUCH_SMALL_EXTENT 1024
// Margin for float estimates, in cells; they err by less than 1/500, see touch_row_span.
#define TOUCH_MARGIN 0.0078125

struct TouchTriangle {
  ivec3 cell_min, cell_max;  // cells of the bounding box that are inside the tile, inclusive
  ivec3 xy0, xy1, xy2;       // (a, b, c): a*i + b*j + c >= 0 where the edge leaves the cell alone
  ivec3 yz0, yz1, yz2;       // the same over (j, k)
  ivec3 zx0, zx1, zx2;       // the same over (k, i)
  TOUCH_INT3 normal;         // of the plane, normal.z >= 0; zero for degenerate triangles
  TOUCH_INT plane;           // s = normal.(i, j, k) + plane
  TOUCH_INT above, below;    // the plane meets the cell iff s + above >= 0 and s - below <= 0
  float inverse_z;           // 1 / normal.z, or 0
};

// Axis a comes to z; cyclic, so that orientation is kept.
ivec3 touch_swizzle(ivec3 v, int axis) {
  return axis == 2 ? v : (axis == 0 ? ivec3(v.y, v.z, v.x) : ivec3(v.z, v.x, v.y));
}

// The axis in which the normal is largest: z before x before y. A triangle without area takes the
// axis in which it is shortest, so that a column holds few of its cells.
int touch_dominant_axis(ivec3 v0, ivec3 v1, ivec3 v2) {
  ivec3 d0 = v1 - v0;
  ivec3 d1 = v2 - v1;
  int64_t x = abs(int64_t(d0.y) * int64_t(d1.z) - int64_t(d0.z) * int64_t(d1.y));
  int64_t y = abs(int64_t(d0.z) * int64_t(d1.x) - int64_t(d0.x) * int64_t(d1.z));
  int64_t z = abs(int64_t(d0.x) * int64_t(d1.y) - int64_t(d0.y) * int64_t(d1.x));
  if (x == int64_t(0) && y == int64_t(0) && z == int64_t(0)) {
    ivec3 extent = max(v0, max(v1, v2)) - min(v0, min(v1, v2));
    x = int64_t(-extent.x);
    y = int64_t(-extent.y);
    z = int64_t(-extent.z);
  }
  return (z >= x && z >= y) ? 2 : (x >= y ? 0 : 1);
}

// 512 times the largest of n * (x - vertex) over the cell's side that begins at 0, for a vertex at
// f + 1/2 of 256 within its cell: never negative, so that >> 9 rounds down.
int touch_reach(int n, int f) { return n >= 0 ? n * (511 - 2 * f) : -n * (2 * f + 1); }
TOUCH_INT touch_reach_wide(TOUCH_INT n, int f) {
  return n >= TOUCH_INT(0) ? n * TOUCH_INT(511 - 2 * f) : -n * TOUCH_INT(2 * f + 1);
}

// Edge function of the edge from (x, y) along (dx, dy), maximal over a cell; side = +1 for
// triangles that are counter-clockwise in this projection, else -1.
ivec3 touch_edge(int x, int y, int dx, int dy, int side) {
  int a = -dy * side;
  int b = dx * side;
  int c = (touch_reach(a, x & 255) + touch_reach(b, y & 255)) >> 9;
  return ivec3(a, b, c - a * (x >> 8) - b * (y >> 8));
}

// Vertices swizzled; cell_last: last cell of the tile inside the grid, swizzled.
TouchTriangle touch_setup(ivec3 v0, ivec3 v1, ivec3 v2, ivec3 cell_last) {
  TouchTriangle t;
  ivec3 low = min(v0, min(v1, v2));
  ivec3 high = max(v0, max(v1, v2));
  t.cell_min = max(ivec3(low.x >> 8, low.y >> 8, low.z >> 8), ivec3(0));
  t.cell_max = min(ivec3(high.x >> 8, high.y >> 8, high.z >> 8), cell_last);
  ivec3 d0 = v1 - v0;
  ivec3 d1 = v2 - v1;
  ivec3 d2 = v0 - v2;
  TOUCH_INT3 n = TOUCH_INT3(TOUCH_INT(d0.y) * TOUCH_INT(d1.z) - TOUCH_INT(d0.z) * TOUCH_INT(d1.y),
                            TOUCH_INT(d0.z) * TOUCH_INT(d1.x) - TOUCH_INT(d0.x) * TOUCH_INT(d1.z),
                            TOUCH_INT(d0.x) * TOUCH_INT(d1.y) - TOUCH_INT(d0.y) * TOUCH_INT(d1.x));
  TOUCH_INT zero = TOUCH_INT(0);
  int side_x = n.x >= zero ? 1 : -1;
  int side_y = n.y >= zero ? 1 : -1;
  int side_z = n.z >= zero ? 1 : -1;
  t.xy0 = touch_edge(v0.x, v0.y, d0.x, d0.y, side_z);
  t.xy1 = touch_edge(v1.x, v1.y, d1.x, d1.y, side_z);
  t.xy2 = touch_edge(v2.x, v2.y, d2.x, d2.y, side_z);
  t.yz0 = touch_edge(v0.y, v0.z, d0.y, d0.z, side_x);
  t.yz1 = touch_edge(v1.y, v1.z, d1.y, d1.z, side_x);
  t.yz2 = touch_edge(v2.y, v2.z, d2.y, d2.z, side_x);
  t.zx0 = touch_edge(v0.z, v0.x, d0.z, d0.x, side_y);
  t.zx1 = touch_edge(v1.z, v1.x, d1.z, d1.x, side_y);
  t.zx2 = touch_edge(v2.z, v2.x, d2.z, d2.x, side_y);
  if (n.z < zero) n = -n;
  t.normal = n;
  t.above = (touch_reach_wide(n.x, v0.x & 255) + touch_reach_wide(n.y, v0.y & 255) +
             touch_reach_wide(n.z, v0.z & 255)) >>
            9;
  t.below = (touch_reach_wide(-n.x, v0.x & 255) + touch_reach_wide(-n.y, v0.y & 255) +
             touch_reach_wide(-n.z, v0.z & 255)) >>
            9;
  t.plane =
      -(n.x * TOUCH_INT(v0.x >> 8) + n.y * TOUCH_INT(v0.y >> 8) + n.z * TOUCH_INT(v0.z >> 8));
  t.inverse_z = n.z == zero ? 0.0f : 1.0f / float(n.z);
  return t;
}

// Whether the projection of the triangle along z meets the column.
bool touch_column(TouchTriangle t, int i, int j) {
  return ((t.xy0.x * i + t.xy0.y * j + t.xy0.z) | (t.xy1.x * i + t.xy1.y * j + t.xy1.z) |
          (t.xy2.x * i + t.xy2.y * j + t.xy2.z)) >= 0;
}

// Whether the projections along x and y meet the cell's.
bool touch_sides(TouchTriangle t, int i, int j, int k) {
  return ((t.yz0.x * j + t.yz0.y * k + t.yz0.z) | (t.yz1.x * j + t.yz1.y * k + t.yz1.z) |
          (t.yz2.x * j + t.yz2.y * k + t.yz2.z) | (t.zx0.x * k + t.zx0.y * i + t.zx0.z) |
          (t.zx1.x * k + t.zx1.y * i + t.zx1.z) | (t.zx2.x * k + t.zx2.y * i + t.zx2.z)) >= 0;
}

TOUCH_INT touch_height(TouchTriangle t, int i, int j) {
  return t.normal.x * TOUCH_INT(i) + t.normal.y * TOUCH_INT(j) + t.plane;
}

// First and last cell of a column that the plane meets, exactly. s = touch_height; low and high:
// estimates of -(s + above) / normal.z and (below - s) / normal.z that err by less than the margin
// (they are quotients of two rounded numbers, at most 3 * 2050 in size: 3 roundings of 2^-24). Then
// the first cell is the estimate's or the one after it, and an integer comparison decides.
ivec2 touch_depth(TouchTriangle t, TOUCH_INT s, float low, float high) {
  if (t.normal.z == TOUCH_INT(0)) return ivec2(t.cell_min.z, t.cell_max.z);
  int first = int(ceil(low - TOUCH_MARGIN));
  int last = int(floor(high + TOUCH_MARGIN));
  if (s + t.normal.z * TOUCH_INT(first) + t.above < TOUCH_INT(0)) first += 1;
  if (s + t.normal.z * TOUCH_INT(last) - t.below > TOUCH_INT(0)) last -= 1;
  return ivec2(max(first, t.cell_min.z), min(last, t.cell_max.z));
}

// One bound of touch_row_span: the columns where a*i + rest >= 0, within [first, last]. May take in
// a column too many, never one too few: the quotient is at most 4096 in size and errs by 2^-10.
ivec2 touch_span_of_edge(ivec2 span, int a, int rest) {
  if (a == 0) return span;
  float at = clamp(-float(rest) / float(a), -4096.0f, 4096.0f);
  return a > 0 ? ivec2(max(span.x, int(ceil(at - TOUCH_MARGIN))), span.y)
               : ivec2(span.x, min(span.y, int(floor(at + TOUCH_MARGIN))));
}

// Columns of row j that can pass touch_column, so that loops skip the rest of the rectangle.
ivec2 touch_row_span(TouchTriangle t, int j, int first, int last) {
  ivec2 span = ivec2(first, last);
  span = touch_span_of_edge(span, t.xy0.x, t.xy0.y * j + t.xy0.z);
  span = touch_span_of_edge(span, t.xy1.x, t.xy1.y * j + t.xy1.z);
  span = touch_span_of_edge(span, t.xy2.x, t.xy2.y * j + t.xy2.z);
  return span;
}
