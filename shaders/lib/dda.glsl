// Traversal of a uniform grid by a ray, after Amanatides & Woo, "A Fast Voxel Traversal Algorithm
// for Ray Tracing" (1987), with two differences. Distances are computed from the integer cell each
// time instead of being added up, so nothing drifts over thousands of cells; and one step may leave
// an aligned block of 2^n cells to a side, whose neighbour cell is found by clamping the position
// into the block, with no epsilon.

const float DDA_FAR = 3.0e38;

struct GridRay {
  vec3 origin;     // grid space
  vec3 direction;  // scaled so that its longest component is 1; exactly 0 on parallel axes
  vec3 inverse;    // 1 / direction; 0 on parallel axes
  bvec3 parallel;  // the ray stays within one layer of cells on this axis
  ivec3 positive;  // 1 where direction > 0, else 0
};

// `direction` is not zero. An axis counts as parallel below 1e-9 of the longest: over the 10^4
// cells of a ray it would not move by 1/1000 of a cell.
GridRay dda_ray(vec3 origin, vec3 direction) {
  vec3 size = abs(direction);
  direction /= max(size.x, max(size.y, size.z));
  GridRay ray;
  ray.origin = origin;
  ray.parallel = lessThan(abs(direction), vec3(1e-9));
  ray.direction = mix(direction, vec3(0.0), ray.parallel);
  ray.inverse = mix(1.0 / direction, vec3(0.0), ray.parallel);
  ray.positive = ivec3(greaterThan(ray.direction, vec3(0.0)));
  return ray;
}

int dda_longest_axis(vec3 direction) {
  vec3 size = abs(direction);
  return size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
}

// Raises t_enter to where the ray enters the box [0, dims). `axis` is the axis of the face that it
// enters through, or -1 where it is inside at t_enter already. False: it misses the box, or leaves
// it before t_enter.
bool dda_enter_grid(GridRay ray, ivec3 dims, inout float t_enter, out int axis) {
  vec3 size = vec3(dims);
  vec3 to_low = -ray.origin * ray.inverse;
  vec3 to_high = (size - ray.origin) * ray.inverse;
  bvec3 below = lessThan(ray.origin, vec3(0.0));
  bvec3 above = greaterThanEqual(ray.origin, size);
  bvec3 outside = bvec3(below.x || above.x, below.y || above.y, below.z || above.z);
  vec3 when_parallel = mix(vec3(-DDA_FAR), vec3(DDA_FAR), outside);
  vec3 first = mix(min(to_low, to_high), when_parallel, ray.parallel);
  vec3 last = mix(max(to_low, to_high), -when_parallel, ray.parallel);
  float t_first = max(first.x, max(first.y, first.z));
  float t_last = min(last.x, min(last.y, last.z));
  axis = -1;
  if (t_first > t_last || t_last < t_enter) return false;
  if (t_first >= t_enter) {
    t_enter = t_first;
    axis = first.x == t_first ? 0 : (first.y == t_first ? 1 : 2);
  }
  return true;
}

// The cell at t, after dda_enter_grid gave t and axis.
ivec3 dda_first_cell(GridRay ray, ivec3 dims, float t, int axis) {
  ivec3 cell = clamp(ivec3(floor(ray.origin + ray.direction * t)), ivec3(0), dims - 1);
  bvec3 is_axis = equal(ivec3(axis), ivec3(0, 1, 2));
  return mix(cell, (dims - 1) * (1 - ray.positive), is_axis);
}

// Moves `cell` to the first cell of the ray beyond the aligned block of 2^shift cells to a side
// around it. Returns where that is; `axis` is the axis of the face between the two.
float dda_leave_block(GridRay ray, int shift, inout ivec3 cell, out int axis) {
  ivec3 low = (cell >> shift) << shift;
  ivec3 plane = low + (ray.positive << shift);
  vec3 t = mix((vec3(plane) - ray.origin) * ray.inverse, vec3(DDA_FAR), ray.parallel);
  axis = t.x <= t.y && t.x <= t.z ? 0 : (t.y <= t.z ? 1 : 2);
  float t_leave = min(t.x, min(t.y, t.z));
  ivec3 at = ivec3(floor(ray.origin + ray.direction * t_leave));
  at = clamp(at, low, low + (1 << shift) - 1);
  // Rounding of the position must not lead back to cells that the ray has passed.
  at = mix(min(at, cell), max(at, cell), equal(ray.positive, ivec3(1)));
  cell = mix(at, plane - (1 - ray.positive), equal(ivec3(axis), ivec3(0, 1, 2)));
  return t_leave;
}

// 0..5 for -x +x -y +y -z +z: the face of the cell that the ray came in through.
int dda_face(GridRay ray, int axis) {
  ivec3 is_axis = ivec3(equal(ivec3(axis), ivec3(0, 1, 2)));
  ivec3 on_high_side = is_axis * (1 - ray.positive);
  return 2 * axis + on_high_side.x + on_high_side.y + on_high_side.z;
}
