// The cells that a triangle occupies by rule thin or center: those in which lines through cells'
// centres meet it, tested in exact integers. server/voxel/README.md defines the rules;
// tests/unit/voxel compiles this file as C++.
//
// Positions and TOUCH_INT are those of lib/touch.glsl. RULE_CENTER: only lines along z of the
// swizzled frame, which is the triangle's dominant axis, and centres on a common side belong to one
// of the two triangles. Otherwise: lines along all axes, and closed triangles.

// A triangle as seen by lines along one axis, rotated cyclically so that this axis is z. Lines run
// through centres of columns (i, j), at 512 i + 256; corners are at 2 q + 1.
struct LinesAlong {
  ivec3 v0, v1, v2;
  ivec3 edge0, edge1, edge2;  // (a, b, c): a*i + b*j + c >= 0 iff the centre is inside
  TOUCH_INT3 normal;          // normal.z >= 0
  TOUCH_INT plane;            // s = normal.(i, j, k) + plane <= 0 iff depth >= k
};

struct Crosshair {
  LinesAlong z;
#ifndef RULE_CENTER
  LinesAlong x, y;
#endif
};

// The function of the edge from (x, y) along (dx, dy), at centres: divided by 512 and rounded down.
// An edge with a = 0 runs between centres.
ivec3 line_edge(int x, int y, int dx, int dy, int side) {
  int a = -dy * side;
  int b = dx * side;
  int sum = a * (255 - 2 * (x & 255)) + b * (255 - 2 * (y & 255));
#ifdef RULE_CENTER
  if (a <= 0) sum -= 1;
#endif
  return ivec3(a, b, (sum >> 9) - a * (x >> 8) - b * (y >> 8));
}

// n.(centre - vertex) for the centre of the floor of the vertex's cell. It is 512 times that,
// divided by 512 and rounded up.
TOUCH_INT line_reach(TOUCH_INT3 n, ivec3 v) {
  ivec3 m = ivec3(255 - 2 * (v.x & 255), 255 - 2 * (v.y & 255), -(2 * (v.z & 255) + 1));
  if (touch_is_negative(n.x)) m.x = -m.x;
  if (touch_is_negative(n.y)) m.y = -m.y;
  TOUCH_INT x = touch_amount(n.x), y = touch_amount(n.y);
  TOUCH_INT sum = touch_plus(touch_times(touch_shifted9(x), m.x),
                             touch_plus(touch_times(touch_shifted9(y), m.y),
                                        touch_times(touch_shifted9(n.z), m.z)));
  int rest = touch_low9(x) * m.x + touch_low9(y) * m.y + touch_low9(n.z) * m.z + 511;
  return touch_plus(sum, touch_int(rest >> 9));
}

// Sets up a triangle with rotated vertices. The sums are no larger than those of touch_setup().
LinesAlong lines_along(ivec3 v0, ivec3 v1, ivec3 v2) {
  LinesAlong t;
  ivec3 d0 = v1 - v0;
  ivec3 d1 = v2 - v1;
  ivec3 d2 = v0 - v2;
  TOUCH_INT3 n;
  n.x = touch_det(d0.y, d1.z, d0.z, d1.y);
  n.y = touch_det(d0.z, d1.x, d0.x, d1.z);
  n.z = touch_det(d0.x, d1.y, d0.y, d1.x);
  int side = touch_is_negative(n.z) ? -1 : 1;
  // A product, because llvmpipe of Mesa 22.3.6 negates 64-bit integers wrongly under a condition.
  n.x = touch_times(n.x, side);
  n.y = touch_times(n.y, side);
  n.z = touch_times(n.z, side);
  t.v0 = v0;
  t.v1 = v1;
  t.v2 = v2;
  t.edge0 = line_edge(v0.x, v0.y, d0.x, d0.y, side);
  t.edge1 = line_edge(v1.x, v1.y, d1.x, d1.y, side);
  t.edge2 = line_edge(v2.x, v2.y, d2.x, d2.y, side);
  t.normal = n;
  t.plane = touch_minus(
      line_reach(n, v0),
      touch_plus(touch_times(n.x, v0.x >> 8),
                 touch_plus(touch_times(n.y, v0.y >> 8), touch_times(n.z, v0.z >> 8))));
  return t;
}

#ifndef RULE_CENTER
// Bit 0: the edge from p to e passes x = i + 1/2 at depth k or more; bit 1: below depth k + 1. If a
// centre lies on a triangle that is seen edge-on, every edge that passes x passes there.
int edge_on_ends(ivec3 p, ivec3 e, int i, int k) {
  int x = 512 * i + 256;
  if (((2 * p.x + 1 - x) ^ (2 * e.x + 1 - x)) >= 0) return 0;  // both on one side
  // Signs are applied in 32 bits. As 64-bit integers, negated under a condition, dx and dz come out
  // wrong on llvmpipe of Mesa 22.3.6 (seen as wrong cells of edge-on triangles).
  int side = e.x > p.x ? 1 : -1;
  int dx = side * (e.x - p.x);
  int dz = side * (e.z - p.z);
  // dx times the depth above the floor of cell k, in 1/512 voxel.
  TOUCH_INT rise = touch_plus(touch_times(touch_int(2 * p.z + 1 - 512 * k), dx),
                              touch_times(touch_int(dz), x - (2 * p.x + 1)));
  bool is_below_top = touch_is_negative(touch_minus(rise, touch_times(touch_int(512), dx)));
  return (touch_is_negative(rise) ? 0 : 1) | (is_below_top ? 2 : 0);
}
#endif

// True if the half-open segment along z through the centre of cell (i, j, k) meets the triangle.
bool line_meets(LinesAlong t, ivec3 cell) {
  if (((t.edge0.x * cell.x + t.edge0.y * cell.y + t.edge0.z) |
       (t.edge1.x * cell.x + t.edge1.y * cell.y + t.edge1.z) |
       (t.edge2.x * cell.x + t.edge2.y * cell.y + t.edge2.z)) < 0) {
    return false;
  }
  if (touch_is_zero(t.normal.z)) {
#ifdef RULE_CENTER
    return false;
#else
    return (edge_on_ends(t.v0, t.v1, cell.x, cell.z) | edge_on_ends(t.v1, t.v2, cell.x, cell.z) |
            edge_on_ends(t.v2, t.v0, cell.x, cell.z)) == 3;
#endif
  }
  TOUCH_INT s = touch_plus(
      touch_plus(touch_times(t.normal.x, cell.x), touch_times(t.normal.y, cell.y)),
      touch_plus(touch_times(t.normal.z, cell.z), t.plane));
  // s <= 0 and s + normal.z > 0
  return touch_is_negative(touch_minus(s, touch_int(1))) &&
         !touch_is_negative(touch_plus(s, touch_minus(t.normal.z, touch_int(1))));
}

// Sets up a triangle with swizzled vertices, as for touch_setup().
Crosshair crosshair_setup(ivec3 v0, ivec3 v1, ivec3 v2) {
  Crosshair c;
  c.z = lines_along(v0, v1, v2);
#ifndef RULE_CENTER
  c.x = lines_along(touch_swizzle(v0, 0), touch_swizzle(v1, 0), touch_swizzle(v2, 0));
  c.y = lines_along(touch_swizzle(v0, 1), touch_swizzle(v1, 1), touch_swizzle(v2, 1));
#endif
  return c;
}

// True if the triangle occupies a cell, which it must touch.
bool crosshair_meets(Crosshair c, ivec3 cell) {
#ifdef RULE_CENTER
  return line_meets(c.z, cell);
#else
  return line_meets(c.z, cell) || line_meets(c.x, touch_swizzle(cell, 0)) ||
         line_meets(c.y, touch_swizzle(cell, 1));
#endif
}
