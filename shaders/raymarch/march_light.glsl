// Ambient occlusion and soft shadows, by secondary rays through the tree from a point on a surface.

// A point whose light is sampled.
struct LitPoint {
  ivec3 cell;   // the first cell of its rays
  vec3 origin;  // relative to its min corner, in cells
};

// A ray from the point towards a world direction. scale: the sides of a voxel over the longest of
// them.
GridRay light_ray(LitPoint point, vec3 direction_world, vec3 scale) {
  return dda_ray(point.cell, point.origin, direction_world / scale);
}

bool light_is_inside(MarchGrid grid, ivec3 cell) {
  return all(greaterThanEqual(cell, grid.low)) && all(lessThan(cell, grid.high));
}

bool light_is_blocked(MarchGrid grid, ivec3 cell, int level) {
  if (!light_is_inside(grid, cell)) return false;
  uint entry = march_entry(grid, cell, level >= 5);
  return march_node_of_entry(entry, cell, level).empty_shift < 0;
}

// A unit vector that is orthogonal to the unit vector n: Duff et al.,
// "Building an Orthonormal Basis, Revisited" (2017).
vec3 light_tangent(vec3 n) {
  float s = n.z >= 0.0f ? 1.0f : -1.0f;
  float a = -1.0f / (s + n.z);
  return vec3(1.0f + s * n.x * n.x * a, s * n.x * n.y * a, -s * n.x);
}

// Point `index` of `count` on the unit disc, spread evenly: Vogel, "A better way to construct the
// sunflower head" (1979).
vec2 light_disc(int index, int count) {
  float radius = sqrt((float(index) + 0.5f) / float(count));
  float angle = 2.3999632f * float(index);
  return radius * vec2(cos(angle), sin(angle));
}

// Distances from which a secondary ray takes cubes of the four levels for occupied:
// `cells_per_level` times their side. Levels that the eye sees count from the start.
vec4 light_levels(int level, float cells_per_level) {
  vec4 begin = cells_per_level * vec4(2.0f, 4.0f, 8.0f, 32.0f);
  return mix(begin, vec4(-1.0f), greaterThanEqual(ivec4(level), ivec4(1, 2, 3, 5)));
}

// The point `offset` longest voxel sides off the surface along `normal` (world). It is never in the
// hit cell or beyond its face.
LitPoint light_point(March found, GridRay eye, vec3 face, vec3 normal, float offset, vec3 scale) {
  ivec3 outward = ivec3(face);
  vec3 at = eye.origin + eye.direction * found.t - vec3(found.cell - eye.base);
  at += normal / scale * offset;
  ivec3 cell = ivec3(floor(at));
  // The face's axis: at least one cell outward. Other axes are unchanged.
  cell = mix(cell, max(cell, outward), equal(outward, ivec3(1)));
  cell = mix(cell, min(cell, outward), equal(outward, ivec3(-1)));
  LitPoint point;
  point.cell = found.cell + cell;
  point.origin = clamp(at - vec3(cell), vec3(0.0f), vec3(1.0f));
  return point;
}

// The distance at which the plane (of grid space) cuts off the rest of a ray, or DDA_FAR. It is
// slightly shortened, so that the ray does not meet voxels that begin at the plane.
float light_section(vec4 section, GridRay ray) {
  vec3 normal = vec3(section.x, section.y, section.z);
  float at = dot(normal, vec3(ray.base) + ray.origin) + section.w;
  float per_t = dot(normal, ray.direction);
  return per_t > 0.0f ? max(-at / per_t - 0.02f, 0.0f) : DDA_FAR;
}

// The share, 0..1, of the light from all around the normal that reaches the point. It is sampled by
// rays first, first + stride, ... of `count`, with the density of Lambert's cosine. Hits `length`
// longest voxel sides away do not count; nearer ones count more.
float light_open(MarchGrid grid, LitPoint point, vec3 normal, vec3 scale, vec4 section, int level,
                 float length, int first, int stride, int count) {
  vec3 tangent = light_tangent(normal), other = cross(normal, tangent);
  float blocked = 0.0f, rays = 0.0f;
  int steps = light_is_inside(grid, point.cell) ? RAYMARCH_OCCLUSION_STEPS : 0;
  for (int i = first; i < count; i += stride) {
    vec2 disc = light_disc(i, count);
    float up = sqrt(max(1.0f - dot(disc, disc), 0.0f));
    vec3 world = tangent * disc.x + other * disc.y + normal * up;
    vec3 cells = abs(world / scale);
    float per_side = max(cells.x, max(cells.y, cells.z));  // t of a voxel side
    GridRay ray = light_ray(point, world, scale);
    float t_max = min(length * per_side, light_section(section, ray));
    March met = march(grid, ray, point.cell, t_max, light_levels(level, 8.0f), steps);
    float near = met.hit ? max(1.0f - met.t / (length * per_side), 0.0f) : 0.0f;
    blocked += near * near;
    rays += 1.0f;
  }
  return 1.0f - blocked / max(rays, 1.0f);
}

// The share, 0..1, of a light that reaches the point. Seen from there the light is a disc around
// `to_light`; `radius` is a fraction of its distance.
float light_shadow(MarchGrid grid, LitPoint point, vec3 to_light, float radius, vec3 scale,
                   vec4 section, int level, int first, int stride, int count) {
  vec3 tangent = light_tangent(to_light), other = cross(to_light, tangent);
  float reached = 0.0f, rays = 0.0f;
  int steps = light_is_inside(grid, point.cell) ? RAYMARCH_SHADOW_STEPS : 0;
  for (int i = first; i < count; i += stride) {
    vec2 disc = light_disc(i, count) * radius;
    vec3 world = tangent * disc.x + other * disc.y + to_light;
    GridRay ray = light_ray(point, world, scale);
    March met = march(grid, ray, point.cell, light_section(section, ray),
                      light_levels(level, 64.0f), steps);
    reached += met.hit ? 0.0f : 1.0f;
    rays += 1.0f;
  }
  return reached / max(rays, 1.0f);
}
