// Traversal of a uniform grid by a ray, after Amanatides & Woo, "A Fast Voxel Traversal Algorithm
// for Ray Tracing" (1987), with three differences. First, distances are computed from the integer
// cell each time instead of being summed, so nothing drifts over thousands of cells. Second, one
// step may leave an aligned block of 2^n cells a side. The neighbour cell is found by clamping the
// position into the block, with no epsilon. Third, positions are relative to the cell in which the
// ray starts, so that single precision serves grids of any size.

const float DDA_FAR = 3.0e38f;

struct GridRay {
  ivec3 base;      // cell that `origin` and t are measured from
  vec3 origin;     // from the min corner of `base`, in cells; t = 0
  vec3 direction;  // scaled so that its longest component is 1; exactly 0 on parallel axes
  vec3 inverse;    // 1 / direction; 0 on parallel axes
  bvec3 parallel;  // the ray stays within one layer of cells on this axis
  ivec3 positive;  // 1 where direction > 0, else 0
};

// The start of a ray among cells [low, high).
struct RayStart {
  GridRay ray;
  bool meets;   // false: the ray misses them
  ivec3 cell;   // the first cell
  int axis;     // axis of the face through which it enters; -1: it begins inside
  float t_max;  // the ray's end
  float t_skipped;  // length from the caller's point to t = 0, in the same units
};

// Makes a ray. Axes below 1e-9 of the longest count as parallel: over the 10^4 cells of a ray, the
// ray would not move by 1/1000 of a cell on them. `direction` must not be zero.
GridRay dda_ray(ivec3 base, vec3 origin, vec3 direction) {
  vec3 size = abs(direction);
  direction /= max(size.x, max(size.y, size.z));
  GridRay ray;
  ray.base = base;
  ray.origin = origin;
  ray.parallel = lessThan(abs(direction), vec3(1e-9f));
  ray.direction = mix(direction, vec3(0.0f), ray.parallel);
  ray.inverse = mix(vec3(1.0f) / direction, vec3(0.0f), ray.parallel);
  ray.positive = ivec3(greaterThan(ray.direction, vec3(0.0f)));
  return ray;
}

int dda_longest_axis(vec3 direction) {
  vec3 size = abs(direction);
  return size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
}

// The distance at which a ray that begins among the cells [low, high) leaves them.
// dda_leave_block() gives less than that if and only if its cell is one of them, because both are
// quotients of the same numbers.
float dda_leave_box(GridRay ray, ivec3 low, ivec3 high) {
  ivec3 plane = mix(low, high, equal(ray.positive, ivec3(1)));
  vec3 t = mix((vec3(plane - ray.base) - ray.origin) * ray.inverse, vec3(DDA_FAR), ray.parallel);
  return min(t.x, min(t.y, t.z));
}

// The part of a ray inside the box of cells [low, high), at most from t_first to t_last. It uses
// double precision, because a camera may be far away from the first cell. The longest component of
// `direction` must be 1.
RayStart dda_start(dvec3 origin, dvec3 direction, double t_first, double t_last, ivec3 low,
                   ivec3 high) {
  dvec3 none = dvec3(0.0f), far = dvec3(DDA_FAR);
  bvec3 parallel = lessThan(abs(direction), dvec3(1e-9f));
  dvec3 inverse = mix(dvec3(1.0f) / direction, none, parallel);
  dvec3 to_low = (dvec3(low) - origin) * inverse;
  dvec3 to_high = (dvec3(high) - origin) * inverse;
  bvec3 below = lessThan(origin, dvec3(low));
  bvec3 above = greaterThanEqual(origin, dvec3(high));
  bvec3 outside = bvec3(below.x || above.x, below.y || above.y, below.z || above.z);
  dvec3 when_parallel = mix(-far, far, outside);
  dvec3 enter = mix(min(to_low, to_high), when_parallel, parallel);
  dvec3 leave = mix(max(to_low, to_high), -when_parallel, parallel);
  double t_enter = max(enter.x, max(enter.y, enter.z));
  double t_leave = min(leave.x, min(leave.y, leave.z));
  double t = max(t_first, t_enter);
  RayStart start;
  start.meets = t_enter <= t_leave && t <= t_leave && t <= t_last;
  start.axis = -1;
  if (t_enter >= t_first) start.axis = enter.x == t_enter ? 0 : (enter.y == t_enter ? 1 : 2);
  dvec3 at = origin + direction * (start.meets ? t : t_first);
  ivec3 positive = ivec3(greaterThan(direction, none));
  ivec3 cell = clamp(ivec3(floor(clamp(at, dvec3(low), dvec3(high)))), low, high - 1);
  bvec3 is_axis = equal(ivec3(start.axis), ivec3(0, 1, 2));
  start.cell = mix(cell, mix(high - 1, low, equal(positive, ivec3(1))), is_axis);
  start.ray = dda_ray(start.cell, vec3(at - dvec3(start.cell)), vec3(direction));
  start.t_max = float(min(t_last - t, double(DDA_FAR)));
  start.t_skipped = float(t);
  return start;
}

// A step: the point at which a ray continues beyond an aligned block.
struct DdaStep {
  ivec3 cell;  // its first cell beyond the block
  int axis;    // axis of the face between the two
  float t;     // distance at that face
};

// Steps out of the aligned block of 2^shift cells a side around `cell`.
DdaStep dda_leave_block(GridRay ray, int shift, ivec3 cell) {
  ivec3 low = (cell >> shift) << shift;
  ivec3 plane = low + (ray.positive << shift);
  vec3 t = mix((vec3(plane - ray.base) - ray.origin) * ray.inverse, vec3(DDA_FAR), ray.parallel);
  DdaStep next;
  next.axis = t.x <= t.y && t.x <= t.z ? 0 : (t.y <= t.z ? 1 : 2);
  next.t = min(t.x, min(t.y, t.z));
  ivec3 at = ray.base + ivec3(floor(ray.origin + ray.direction * next.t));
  at = clamp(at, low, low + ((1 << shift) - 1));
  // Rounding of the position must not lead back to cells that the ray has passed.
  at = mix(min(at, cell), max(at, cell), equal(ray.positive, ivec3(1)));
  next.cell = mix(at, plane - (1 - ray.positive), equal(ivec3(next.axis), ivec3(0, 1, 2)));
  return next;
}

// The face of the cell through which the ray came in: 0..5 for -x +x -y +y -z +z.
int dda_face(GridRay ray, int axis) {
  ivec3 is_axis = ivec3(equal(ivec3(axis), ivec3(0, 1, 2)));
  ivec3 on_high_side = is_axis * (1 - ray.positive);
  return 2 * axis + on_high_side.x + on_high_side.y + on_high_side.z;
}
