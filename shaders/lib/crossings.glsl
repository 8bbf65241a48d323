// Crossings of the centre line of a column with a triangle, exactly; see server/voxel/README.md,
// "What is inside". tests/unit/voxel compiles this file as C++.
//
// Corners are integers in 1/512 voxel, all odd, from the tile's min corner: (u, v, w) with columns
// along w. Centres of cells are at 512 k + 256. With corners below CROSSING_P_MAX in size all
// results fit 64 bits. An edge function is 2^44. The normal, twice an area in a square of 2^22, is
// 2^43. The sum of its products with depths below 2^21 on three axes is at most 2^63; sums may wrap
// on the way.
#define CROSSING_P_MAX ((1 << 20) + (1 << 11))

struct ColumnTriangle {
  ivec3 origin;          // a corner
  i64vec3 edge0, edge1, edge2;  // a*u + b*v + c >= 0 iff the point lies inside
  i64vec3 normal;        // normal.z > 0; 0 if the triangle is edge-on: it crosses nothing
  int64_t unit;          // a cell's height, times normal.z
  float inverse_unit;
  int winding;           // +1: faces down, so a path that goes up enters
};

// A point exactly on a side is inside if the side's interior lies to its right, or above a level
// side. Neighbours that share the side then count the point once.
i64vec3 crossing_edge(ivec3 from, ivec3 to) {
  int a = from.y - to.y;
  int b = to.x - from.x;
  int outside = (a > 0 || (a == 0 && b > 0)) ? 0 : 1;
  int64_t c = -(int64_t(a) * int64_t(from.x)) - int64_t(b) * int64_t(from.y) - int64_t(outside);
  return i64vec3(int64_t(a), int64_t(b), c);
}

int64_t crossing_normal(int a0, int b0, int a1, int b1) {
  return int64_t(a0) * int64_t(b1) - int64_t(b0) * int64_t(a1);
}

ColumnTriangle crossing_setup(ivec3 v0, ivec3 v1, ivec3 v2) {
  ColumnTriangle t;
  int64_t facing = crossing_normal(v1.x - v0.x, v1.y - v0.y, v2.x - v0.x, v2.y - v0.y);
  bool faces_down = facing < int64_t(0);
  // Corners are swapped instead of signs. Negated under a condition, 64-bit integers come out wrong
  // on llvmpipe of Mesa 22.3.6.
  ivec3 b = faces_down ? v2 : v1;
  ivec3 c = faces_down ? v1 : v2;
  ivec3 d1 = b - v0;
  ivec3 d2 = c - v0;
  t.winding = faces_down ? 1 : -1;
  t.origin = v0;
  t.normal = i64vec3(crossing_normal(d1.y, d1.z, d2.y, d2.z),
                     crossing_normal(d1.z, d1.x, d2.z, d2.x),
                     crossing_normal(d1.x, d1.y, d2.x, d2.y));
  t.unit = t.normal.z * int64_t(512);
  t.inverse_unit = t.normal.z == int64_t(0) ? 0.0f : 1.0f / float(t.unit);
  t.edge0 = crossing_edge(v0, b);
  t.edge1 = crossing_edge(b, c);
  t.edge2 = crossing_edge(c, v0);
  return t;
}

int64_t crossing_edge_at(i64vec3 edge, int u, int v) {
  return edge.x * int64_t(512 * u + 256) + edge.y * int64_t(512 * v + 256) + edge.z;
}

// True if the column's centre lies inside the projection.
bool crossing_inside(ColumnTriangle t, int u, int v) {
  return t.normal.z != int64_t(0) && crossing_edge_at(t.edge0, u, v) >= int64_t(0) &&
         crossing_edge_at(t.edge1, u, v) >= int64_t(0) &&
         crossing_edge_at(t.edge2, u, v) >= int64_t(0);
}

// The least k with k + 1/2 >= the depth of the triangle's plane, for a column inside. The quotient
// is at most 2^12 in size and a float's error is below 2^-9, so the remainder corrects the
// estimate.
int crossing_first_cell(ColumnTriangle t, int u, int v) {
  int64_t numerator = t.normal.z * int64_t(t.origin.z - 256) -
                      t.normal.x * int64_t(512 * u + 256 - t.origin.x) -
                      t.normal.y * int64_t(512 * v + 256 - t.origin.y);
  int k = int(ceil(float(numerator) * t.inverse_unit));
  int64_t rest = numerator - int64_t(k) * t.unit;
  if (rest > int64_t(0)) k += 1;
  if (rest + t.unit <= int64_t(0)) k -= 1;
  return k;
}
