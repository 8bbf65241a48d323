// The ground under the grid, which shows nothing but the light that the grid keeps from it.

// A ray from a point outside or inside the grid's box.
struct GroundRay {
  RayStart start;
  vec4 level_t;  // of march()
  float far;     // its t, from the point on, at which a hit no longer counts; DDA_FAR: each does
};

// length: longest voxel sides at which a hit no longer counts; DDA_FAR or more: each counts.
// section: a plane of grid space, or 0. scale: the sides of a voxel over the longest of them.
GroundRay ground_ray(MarchGrid grid, dvec3 from, vec3 world, vec3 scale, float length,
                     vec4 section, float cells_per_level) {
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
  if (at > 0.0) t_first = per_t < 0.0 ? -at / per_t : double(DDA_FAR);
  if (at <= 0.0 && per_t > 0.0) t_last = min(t_last, -at / per_t - 0.02);
  GroundRay ray;
  ray.start = dda_start(from, direction, t_first, t_last, grid.low, grid.high);
  // Cubes are larger at larger distances from the point, which may be far from the box.
  ray.level_t = light_levels(0, cells_per_level) - ray.start.t_skipped;
  ray.far = length < DDA_FAR ? length * per_side : DDA_FAR;
  return ray;
}

// 1 for a voxel at the point itself, down to 0 at the ray's end; for a ray without end 1. t: of the
// hit.
float ground_nearness(GroundRay ray, float t) {
  if (ray.far >= DDA_FAR) return 1.0f;
  return max(1.0f - (t + ray.start.t_skipped) / ray.far, 0.0f);
}

// The nearness of what the ray meets, or 0.
float ground_meets(MarchGrid grid, GroundRay ray, int steps) {
  March met = march(grid, ray.start.ray, ray.start.cell, ray.start.t_max, ray.level_t,
                    ray.start.meets ? steps : 0);
  return met.hit ? ground_nearness(ray, met.t) : 0.0f;
}

// The rays that sample a point of the floor. world: towards the light, and all around.
vec3 ground_to_light(vec3 to_light, vec2 disc) {
  vec3 tangent = light_tangent(to_light), other = cross(to_light, tangent);
  vec2 on_light = disc * RAYMARCH_GROUND_LIGHT_RADIUS;
  return tangent * on_light.x + other * on_light.y + to_light;
}
vec3 ground_upward(vec2 disc) {
  return vec3(disc.x, sqrt(max(1.0f - dot(disc, disc), 0.0f)), disc.y);
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

// How dark the floor is at a point, 0..1, by the shadow of the light and by what stands near. Each
// is sampled by `count` rays.
float ground_darkness(MarchGrid grid, dvec3 from, vec3 to_light, vec3 scale, float length,
                      vec4 section, int count) {
  vec3 low = vec3(grid.low) * scale, high = vec3(grid.high) * scale, at = vec3(from) * scale;
  vec3 outside = max(max(low - at, at - high), vec3(0.0f));
  bool is_near = dot(outside, outside) < length * length;
  bool is_below = ground_may_be_shadowed(at, low, high, to_light);
  if (!is_near && !is_below) return 0.0f;
  float shadow = 0.0f, near = 0.0f;
#ifdef RAYMARCH_LANES  // in C++ several rays at a time
  lanes_ground(*this, grid, from, to_light, scale, length, section, count, is_below, is_near,
               shadow, near);
#else
  for (int i = 0; i < count; ++i) {
    vec2 disc = light_disc(i, count);
    if (is_below) {
      GroundRay ray = ground_ray(grid, from, ground_to_light(to_light, disc), scale, DDA_FAR,
                                 section, 32.0f);
      shadow += ground_meets(grid, ray, RAYMARCH_SHADOW_STEPS);
    }
    if (is_near) {
      GroundRay ray =
          ground_ray(grid, from, ground_upward(disc), scale, length, section, 8.0f);
      float met = ground_meets(grid, ray, RAYMARCH_OCCLUSION_STEPS);
      near += met * met;
    }
  }
#endif
  float rays = float(count);
  return 1.0f - (1.0f - 0.42f * shadow / rays) * (1.0f - 0.55f * near / rays);
}
