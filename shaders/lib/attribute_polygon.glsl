// Convex polygons in a column of cells, seen along the column, in integers: the intersection of a
// triangle with a cell. Points have x and y from 0 to 4096, in 2^-12 cells from the column's
// corner.

// A square clipped by five lines has at most 9 corners.
#define CELL_POLYGON_MAX 9
#define CELL_POLYGON_SIDE 4096

struct CellPolygon {
  int count;                      // 0: empty
  uint points[CELL_POLYGON_MAX];  // x | y << 16, counter-clockwise
};

ivec2 polygon_point(uint point) { return ivec2(int(point & 0xffffu), int(point >> 16)); }

CellPolygon whole_column() {
  CellPolygon polygon;
  polygon.count = 4;
  polygon.points[0] = 0u;
  polygon.points[1] = uint(CELL_POLYGON_SIDE);
  polygon.points[2] = uint(CELL_POLYGON_SIDE) * 65537u;
  polygon.points[3] = uint(CELL_POLYGON_SIDE) << 16;
  return polygon;
}

int line_value(ivec3 line, uint point) {
  ivec2 p = polygon_point(point);
  return line.x * p.x + line.y * p.y + line.z;
}

// The point where a side leaves, from a point inside to one outside. It is rounded to the nearest
// 2^-12 cell.
uint line_cut(uint inside, uint outside, int value_inside, int value_outside) {
  uint part = uint(value_inside), whole = part + uint(-value_outside);
  int shift = max(findMSB(whole) - 17, 0);
  int t = int(((part >> shift) * uint(CELL_POLYGON_SIDE)) / (whole >> shift));
  ivec2 from = polygon_point(inside), to = polygon_point(outside);
  ivec2 at = from + (((to - from) * t + CELL_POLYGON_SIDE / 2) >> 12);
  return uint(at.x) | (uint(at.y) << 16);
}

// Keeps the part where the line's value is at least 0 (Sutherland & Hodgman 1974). Values of a line
// in the column are below 2^30 in size. If rounding makes a polygon slightly concave, a tenth
// corner would arise; it is dropped.
CellPolygon clip_polygon(CellPolygon polygon, ivec3 line) {
  if (line.z + CELL_POLYGON_SIDE * (min(line.x, 0) + min(line.y, 0)) >= 0) return polygon;
  CellPolygon kept;
  kept.count = 0;
  if (polygon.count == 0) return kept;
  uint last = polygon.points[polygon.count - 1];
  int last_value = line_value(line, last);
  for (int n = 0; n < polygon.count; ++n) {
    uint next = polygon.points[n];
    int value = line_value(line, next);
    if ((last_value < 0) != (value < 0) && kept.count < CELL_POLYGON_MAX) {
      kept.points[kept.count] = value < 0 ? line_cut(last, next, last_value, value)
                                          : line_cut(next, last, value, last_value);
      ++kept.count;
    }
    if (value >= 0 && kept.count < CELL_POLYGON_MAX) {
      kept.points[kept.count] = next;
      ++kept.count;
    }
    last = next;
    last_value = value;
  }
  return kept;
}

// Twice the area of triangle n of the fan about point 0, n = 1 .. count - 2. A cell's face has
// 2^25.
uint twice_fan_area(CellPolygon polygon, int n) {
  ivec2 p = polygon_point(polygon.points[0]);
  ivec2 a = polygon_point(polygon.points[n]) - p, b = polygon_point(polygon.points[n + 1]) - p;
  return uint(max(a.x * b.y - a.y * b.x, 0));
}

uint twice_polygon_area(CellPolygon polygon) {
  uint sum = 0u;
  for (int n = 1; n + 1 < polygon.count; ++n) sum += twice_fan_area(polygon, n);
  return sum;
}

// twice_area: the polygon's, not 0.
ivec2 polygon_centroid(CellPolygon polygon, uint twice_area) {
  int shift = max(findMSB(twice_area) - 16, 0);
  ivec2 p = polygon_point(polygon.points[0]);
  uint x = 0u, y = 0u, all = 0u;
  for (int n = 1; n + 1 < polygon.count; ++n) {
    ivec2 sum = p + polygon_point(polygon.points[n]) + polygon_point(polygon.points[n + 1]);
    uint area = twice_fan_area(polygon, n) >> shift;
    x += area * uint(sum.x);
    y += area * uint(sum.y);
    all += area;
  }
  if (all == 0u) return p;
  return ivec2(int(x / (3u * all)), int(y / (3u * all)));
}
