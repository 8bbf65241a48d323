// The ground under the grid, which shows nothing but the light that the grid keeps from it.

// A ray from a point outside or inside the grid's box: 0 if it meets nothing, 1 for a voxel at the
// point itself, in between by the distance as a share of `length` (longest voxel sides). A length
// of DDA_FAR or more gives 0 or 1. section: a plane of grid space, or 0. scale: the sides of a
// voxel over the longest of them.
float ground_meets(MarchGrid grid, dvec3 from, vec3 world, vec3 scale, float length, vec4 section,
                   float cells_per_level, int steps) {
  vec3 cells = world / scale;
  vec3 size = abs(cells);
  float per_side = max(size.x, max(size.y, size.z));  // t of a voxel side
  dvec3 direction = dvec3(cells / per_side);
  double t_first = 0.0, t_last = length < DDA_FAR ? double(length * per_side) : double(DDA_FAR);
  // Voxels that the section cuts away keep no light. It ends a little earlier, as in
  // light_section().
  dvec3 normal = dvec3(section.x, section.y, section.z);
  double at = dot(normal, from) + double(section.w);
  double per_t = dot(normal, direction);
  if (at > 0.0 && per_t >= 0.0) return 0.0f;
  if (at > 0.0) t_first = -at / per_t;
  if (at <= 0.0 && per_t > 0.0) t_last = min(t_last, -at / per_t - 0.02);
  RayStart start = dda_start(from, direction, t_first, t_last, grid.low, grid.high);
  // Cubes are larger at larger distances from the point, which may be far from the box.
  vec4 level_t = light_levels(0, cells_per_level) - start.t_skipped;
  March met = march(grid, start.ray, start.cell, start.t_max, level_t, start.meets ? steps : 0);
  if (!met.hit) return 0.0f;
  if (length >= DDA_FAR) return 1.0f;
  return max(1.0f - (met.t + start.t_skipped) / (length * per_side), 0.0f);
}

// Whether rays towards the light from the point may meet the grid's box: the strip under them, as
// high as the box, against the box seen from above. Lengths are in longest voxel sides.
bool ground_may_be_shadowed(vec3 from, vec3 low, vec3 high, vec3 to_light) {
  float steep = to_light.y - RAYMARCH_GROUND_LIGHT_RADIUS;
  if (steep <= 0.05f) return true;
  vec2 run = vec2(to_light.x, to_light.z) * ((high.y - from.y) / to_light.y);
  float wide = (high.y - from.y) * 2.0f * RAYMARCH_GROUND_LIGHT_RADIUS / (steep * steep);
  vec2 first = vec2(from.x, from.z), last = first + run;
  vec2 begin = min(first, last) - vec2(wide), end = max(first, last) + vec2(wide);
  return begin.x <= high.x && end.x >= low.x && begin.y <= high.z && end.y >= low.z;
}

// How dark the floor is at a point, 0..1, by the shadow of the light and by what stands near. It is
// sampled by rays first, first + stride, ... of `count`.
float ground_darkness(MarchGrid grid, dvec3 from, vec3 to_light, vec3 scale, float length,
                      vec4 section, int first, int stride, int count) {
  vec3 low = vec3(grid.low) * scale, high = vec3(grid.high) * scale, at = vec3(from) * scale;
  vec3 outside = max(max(low - at, at - high), vec3(0.0f));
  bool is_near = dot(outside, outside) < length * length;
  bool is_below = ground_may_be_shadowed(at, low, high, to_light);
  if (!is_near && !is_below) return 0.0f;
  vec3 tangent = light_tangent(to_light), other = cross(to_light, tangent);
  float shadow = 0.0f, near = 0.0f, rays = 0.0f;
  for (int i = first; i < count; i += stride) {
    vec2 disc = light_disc(i, count);
    if (is_below) {
      vec2 on_light = disc * RAYMARCH_GROUND_LIGHT_RADIUS;
      shadow += ground_meets(grid, from, tangent * on_light.x + other * on_light.y + to_light,
                             scale, DDA_FAR, section, 32.0f, RAYMARCH_SHADOW_STEPS);
    }
    if (is_near) {
      float up = sqrt(max(1.0f - dot(disc, disc), 0.0f));
      float met = ground_meets(grid, from, vec3(disc.x, up, disc.y), scale, length, section, 8.0f,
                               RAYMARCH_OCCLUSION_STEPS);
      near += met * met;
    }
    rays += 1.0f;
  }
  rays = max(rays, 1.0f);
  return 1.0f - (1.0f - 0.42f * shadow / rays) * (1.0f - 0.55f * near / rays);
}
