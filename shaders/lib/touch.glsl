// The cells of a tile that a triangle touches, exactly: the plane test and the three 2D projections
// of Schwarz & Seidel 2010, "Fast parallel surface and solid voxelization on GPUs", in integers.
// server/voxel/README.md defines touching; tests/unit/voxel compiles this file as C++.
//
// Vertices are integers q in 1/256 voxel and are at q + 1/2, so that none lies on a cell's boundary
// 256 k. All positions are relative to the tile's min corner and swizzled: z is the triangle's
// dominant axis, and a column (i, j) is a stack of cells along it.
//
// TOUCH_INT (lib/touch_int.glsl) is the integer of the plane test: int for triangles up to
// TOUCH_SMALL_EXTENT wide, else int64_t or two words (at most 2^51). Everything else fits int up to
// 2048 cells: an edge function is twice the area of a triangle in the grid's box, over 256.
#include "shaders/lib/touch_int.glsl"
// The largest extent of a small triangle, in 1/256 voxel on each axis. |normal| is then <= 2^24 on
// each axis (twice the area of a projection, which is in the box). Heights are counted over the
// triangle's own 17 cells, where sums are below 3 * 17 * 2^24 + 3 * 2^24 < 2^30.
#define TOUCH_SMALL_EXTENT 4096
// Margin for float estimates, in cells; they err by less than 1/500, see touch_row_span.
#define TOUCH_MARGIN 0.0078125

struct TouchTriangle {
  ivec3 cell_min, cell_max;  // cells of the bounding box that are inside the tile, inclusive
  // (a, b, c): a*i + b*j + c >= 0 unless the edge separates the cell from the triangle.
  ivec3 xy0, xy1, xy2;
  ivec3 yz0, yz1, yz2;       // the same over (j, k)
  ivec3 zx0, zx1, zx2;       // the same over (k, i)
  TOUCH_INT3 normal;         // normal of the plane, normal.z >= 0; zero for degenerate triangles
  TOUCH_INT plane;           // s = normal.(i, j, k - base_z) + plane
  int base_z;                // lowest cell of the bounding box
  TOUCH_INT above, below;    // the plane meets the cell iff s + above >= 0 and s - below <= 0
  float inverse_z;           // 1 / normal.z, or 0
};

// Rotates axes so that axis a becomes z. The rotation is cyclic, which keeps the orientation.
ivec3 touch_swizzle(ivec3 v, int axis) {
  return axis == 2 ? v : (axis == 0 ? ivec3(v.y, v.z, v.x) : ivec3(v.z, v.x, v.y));
}

// The axis in which the normal is largest; z wins ties over x, and x over y. A triangle without
// area takes the axis in which it is shortest, so that a column holds few of its cells.
int touch_dominant_axis(ivec3 v0, ivec3 v1, ivec3 v2) {
  ivec3 d0 = v1 - v0;
  ivec3 d1 = v2 - v1;
  TOUCH_INT x = touch_amount(touch_det(d0.y, d1.z, d0.z, d1.y));
  TOUCH_INT y = touch_amount(touch_det(d0.z, d1.x, d0.x, d1.z));
  TOUCH_INT z = touch_amount(touch_det(d0.x, d1.y, d0.y, d1.x));
  if (touch_is_zero(x) && touch_is_zero(y) && touch_is_zero(z)) {
    ivec3 extent = max(v0, max(v1, v2)) - min(v0, min(v1, v2));
    x = touch_int(-extent.x);
    y = touch_int(-extent.y);
    z = touch_int(-extent.z);
  }
  if (!touch_is_negative(touch_minus(z, x)) && !touch_is_negative(touch_minus(z, y))) return 2;
  return touch_is_negative(touch_minus(x, y)) ? 1 : 0;
}

// 512 times the largest of n * (x - vertex) over the cell's side that begins at 0. The vertex is at
// f + 1/2 of 256 within its cell. The result is never negative, so that >> 9 rounds down.
int touch_reach(int n, int f) { return n >= 0 ? n * (511 - 2 * f) : -n * (2 * f + 1); }
// The same for the three axes of n together, >> 9, with no product wider than n.
TOUCH_INT touch_reach_of_plane(TOUCH_INT3 n, ivec3 f, bool is_negated) {
  ivec3 m;
  m.x = touch_is_negative(n.x) != is_negated ? 2 * f.x + 1 : 511 - 2 * f.x;
  m.y = touch_is_negative(n.y) != is_negated ? 2 * f.y + 1 : 511 - 2 * f.y;
  m.z = touch_is_negative(n.z) != is_negated ? 2 * f.z + 1 : 511 - 2 * f.z;
  TOUCH_INT x = touch_amount(n.x), y = touch_amount(n.y), z = touch_amount(n.z);
  TOUCH_INT sum = touch_plus(touch_times(touch_shifted9(x), m.x),
                             touch_plus(touch_times(touch_shifted9(y), m.y),
                                        touch_times(touch_shifted9(z), m.z)));
  int rest = touch_low9(x) * m.x + touch_low9(y) * m.y + touch_low9(z) * m.z;
  return touch_plus(sum, touch_int(rest >> 9));
}

// Edge function of the edge from (x, y) along (dx, dy), maximal over a cell; side = +1 for
// triangles that are counter-clockwise in this projection, else -1.
ivec3 touch_edge(int x, int y, int dx, int dy, int side) {
  int a = -dy * side;
  int b = dx * side;
  int c = (touch_reach(a, x & 255) + touch_reach(b, y & 255)) >> 9;
  return ivec3(a, b, c - a * (x >> 8) - b * (y >> 8));
}

// Sets up a triangle. Vertices are swizzled; cell_last: last cell of the tile inside the grid,
// swizzled.
TouchTriangle touch_setup(ivec3 v0, ivec3 v1, ivec3 v2, ivec3 cell_last) {
  TouchTriangle t;
  ivec3 low = min(v0, min(v1, v2));
  ivec3 high = max(v0, max(v1, v2));
  t.cell_min = max(ivec3(low.x >> 8, low.y >> 8, low.z >> 8), ivec3(0));
  t.cell_max = min(ivec3(high.x >> 8, high.y >> 8, high.z >> 8), cell_last);
  ivec3 d0 = v1 - v0;
  ivec3 d1 = v2 - v1;
  ivec3 d2 = v0 - v2;
  TOUCH_INT3 n;
  n.x = touch_det(d0.y, d1.z, d0.z, d1.y);
  n.y = touch_det(d0.z, d1.x, d0.x, d1.z);
  n.z = touch_det(d0.x, d1.y, d0.y, d1.x);
  int side_x = touch_is_negative(n.x) ? -1 : 1;
  int side_y = touch_is_negative(n.y) ? -1 : 1;
  int side_z = touch_is_negative(n.z) ? -1 : 1;
  t.xy0 = touch_edge(v0.x, v0.y, d0.x, d0.y, side_z);
  t.xy1 = touch_edge(v1.x, v1.y, d1.x, d1.y, side_z);
  t.xy2 = touch_edge(v2.x, v2.y, d2.x, d2.y, side_z);
  t.yz0 = touch_edge(v0.y, v0.z, d0.y, d0.z, side_x);
  t.yz1 = touch_edge(v1.y, v1.z, d1.y, d1.z, side_x);
  t.yz2 = touch_edge(v2.y, v2.z, d2.y, d2.z, side_x);
  t.zx0 = touch_edge(v0.z, v0.x, d0.z, d0.x, side_y);
  t.zx1 = touch_edge(v1.z, v1.x, d1.z, d1.x, side_y);
  t.zx2 = touch_edge(v2.z, v2.x, d2.z, d2.x, side_y);
  // A product, because llvmpipe of Mesa 22.3.6 negates 64-bit integers wrongly under a condition.
  n.x = touch_times(n.x, side_z);
  n.y = touch_times(n.y, side_z);
  n.z = touch_times(n.z, side_z);
  t.normal = n;
  t.above = touch_reach_of_plane(n, v0 & 255, false);
  t.below = touch_reach_of_plane(n, v0 & 255, true);
  t.base_z = low.z >> 8;
  t.plane = touch_negated(touch_plus(
      touch_times(n.x, v0.x >> 8),
      touch_plus(touch_times(n.y, v0.y >> 8), touch_times(n.z, (v0.z >> 8) - t.base_z))));
  t.inverse_z = touch_is_zero(n.z) ? 0.0f : 1.0f / touch_float(n.z);
  return t;
}

// True if the projection of the triangle along z meets the column.
bool touch_column(TouchTriangle t, int i, int j) {
  return ((t.xy0.x * i + t.xy0.y * j + t.xy0.z) | (t.xy1.x * i + t.xy1.y * j + t.xy1.z) |
          (t.xy2.x * i + t.xy2.y * j + t.xy2.z)) >= 0;
}

// True if the projections along x and y meet the cell's.
bool touch_sides(TouchTriangle t, int i, int j, int k) {
  return ((t.yz0.x * j + t.yz0.y * k + t.yz0.z) | (t.yz1.x * j + t.yz1.y * k + t.yz1.z) |
          (t.yz2.x * j + t.yz2.y * k + t.yz2.z) | (t.zx0.x * k + t.zx0.y * i + t.zx0.z) |
          (t.zx1.x * k + t.zx1.y * i + t.zx1.z) | (t.zx2.x * k + t.zx2.y * i + t.zx2.z)) >= 0;
}

TOUCH_INT touch_height(TouchTriangle t, int i, int j) {
  return touch_plus(touch_plus(touch_times(t.normal.x, i), touch_times(t.normal.y, j)), t.plane);
}

// First and last cell of a column that the plane meets, exactly. s = touch_height; low and high:
// touch_low() and touch_high() of s. These err by less than the margin: they are quotients of two
// rounded numbers, at most 3 * 2050 in size, with 3 roundings of 2^-24 (2^-23 in two words). The
// first cell is then the estimate's or the one after it, and an integer comparison decides.
ivec2 touch_depth(TouchTriangle t, TOUCH_INT s, float low, float high) {
  if (touch_is_zero(t.normal.z)) return ivec2(t.cell_min.z, t.cell_max.z);
  int first = int(ceil(low - TOUCH_MARGIN));
  int last = int(floor(high + TOUCH_MARGIN));
  TOUCH_INT at_first = touch_plus(touch_plus(s, touch_times(t.normal.z, first)), t.above);
  TOUCH_INT at_last = touch_minus(t.below, touch_plus(s, touch_times(t.normal.z, last)));
  if (touch_is_negative(at_first)) first += 1;
  if (touch_is_negative(at_last)) last -= 1;
  return ivec2(max(first + t.base_z, t.cell_min.z), min(last + t.base_z, t.cell_max.z));
}
float touch_low(TouchTriangle t, TOUCH_INT s) {
  return -touch_float(touch_plus(s, t.above)) * t.inverse_z;
}
float touch_high(TouchTriangle t, TOUCH_INT s) {
  return touch_float(touch_minus(t.below, s)) * t.inverse_z;
}

// Narrows the span of touch_row_span to the columns where a*i + rest >= 0. The result may have one
// column too many, never one too few: the quotient is at most 4096 in size and errs by 2^-10.
ivec2 touch_span_of_edge(ivec2 span, int a, int rest) {
  if (a == 0) return span;
  float at = clamp(-float(rest) / float(a), -4096.0f, 4096.0f);
  return a > 0 ? ivec2(max(span.x, int(ceil(at - TOUCH_MARGIN))), span.y)
               : ivec2(span.x, min(span.y, int(floor(at + TOUCH_MARGIN))));
}

// Columns of row j that can pass touch_column. Loops need not visit the rest of the rectangle.
ivec2 touch_row_span(TouchTriangle t, int j, int first, int last) {
  ivec2 span = ivec2(first, last);
  span = touch_span_of_edge(span, t.xy0.x, t.xy0.y * j + t.xy0.z);
  span = touch_span_of_edge(span, t.xy1.x, t.xy1.y * j + t.xy1.z);
  span = touch_span_of_edge(span, t.xy2.x, t.xy2.y * j + t.xy2.z);
  return span;
}
