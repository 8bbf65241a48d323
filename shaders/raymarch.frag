// Ray march through a sparse grid, see raymarch/march.glsl. With RAYMARCH_HITS the pass returns the
// voxel that each pixel's ray hits first; otherwise it renders. Then RAYMARCH_ATTRIBUTES (voxels
// have colours or normals), RAYMARCH_SMOOTH (normals are estimated), RAYMARCH_LIGHT (there is
// ambient occlusion or a shadow), RAYMARCH_GROUND (there is a floor) and RAYMARCH_OUTLINE (there
// are outlines and nothing else) are 0 or 1. They are defines, because software drivers execute
// code behind a condition even if no invocation takes it.
#include "shared/raymarch.h"
#include "raymarch/dda.glsl"
#include "raymarch/dda_brick.glsl"
#include "raymarch/dda_normal.glsl"
#include "raymarch/march_tree.glsl"
#include "raymarch/march.glsl"
#include "raymarch/march_light.glsl"
#include "raymarch/march_ground.glsl"
#include "raymarch/march_normal.glsl"
#include "raymarch/shading.glsl"
#include "raymarch/march_attributes.glsl"

layout(std140, binding = RAYMARCH_PARAMS) uniform Params { RaymarchParams params; };
layout(std430, binding = RAYMARCH_NODES) readonly buffer Nodes { uint nodes[]; };
layout(std430, binding = RAYMARCH_BRICKS) readonly buffer Bricks { uint bricks[]; };
layout(std430, binding = RAYMARCH_COLORS) readonly buffer Colors { uint colors[]; };
layout(std430, binding = RAYMARCH_NORMALS) readonly buffer Normals { uint normals[]; };

uint node_word(uint index) { return nodes[index]; }
uint brick_word(uint index) { return bricks[index]; }
uint color_word(uint index) { return colors[index]; }
uint normal_word(uint index) { return normals[index]; }

bool has(uint flag) { return (uint(params.image.z) & flag) != 0u; }

MarchGrid march_grid() {
  return MarchGrid(params.box_low.xyz, params.box_high.xyz, params.tile_dims.xyz);
}

// A pixel's ray before it meets the grid, in grid space.
struct EyeRay {
  dvec3 origin, direction;  // the longest component of the direction is 1
  double t_first, t_last;   // from the near to the far plane, on the kept side of the section
};

dvec4 both(vec4 high, vec4 low) { return dvec4(high) + dvec4(low); }

// The ray through a position of the image in pixels. It uses homogeneous points, so a far plane at
// infinity works.
EyeRay image_ray(vec2 pixel) {
  vec2 at = pixel / vec2(params.image.xy) * 2.0 - 1.0;
  dvec4 near = both(params.near_0, params.near_0_low) +
               double(at.x) * both(params.near_x, params.near_x_low) +
               double(at.y) * both(params.near_y, params.near_y_low);
  dvec4 far = both(params.far_0, params.far_0_low) +
              double(at.x) * both(params.far_x, params.far_x_low) +
              double(at.y) * both(params.far_y, params.far_y_low);
  dvec3 direction = far.xyz * near.w - near.xyz * far.w;
  double weight = far.w * near.w;
  if (weight < 0.0) direction = -direction;
  dvec3 size = abs(direction);
  double longest = max(size.x, max(size.y, size.z));
  EyeRay ray;
  ray.origin = near.xyz / near.w;
  ray.direction = direction / longest;
  ray.t_first = 0.0;
  ray.t_last = weight == 0.0 ? double(DDA_FAR) : longest / abs(weight);
  return ray;
}

// The part of the ray on the kept side of the section plane.
EyeRay clipped_to_section(EyeRay ray) {
  dvec4 plane = both(params.section, params.section_low);
  double at_origin = dot(plane.xyz, ray.origin) + plane.w;
  double per_t = dot(plane.xyz, ray.direction);
  if (per_t == 0.0) {
    if (at_origin > 0.0) ray.t_last = -1.0;
  } else if (per_t < 0.0) {
    ray.t_first = max(ray.t_first, -at_origin / per_t);
  } else {
    ray.t_last = min(ray.t_last, -at_origin / per_t);
  }
  return ray;
}

// A ray that is about to march.
struct Look {
  RayStart start;
  vec4 level_t;   // of march()
  bool from_cut;  // it begins at the section plane
};

struct Sight {
  RayStart start;
  March found;
  bool on_section;  // the ray starts on the section plane, inside the voxel
};

// Distances along a ray from which cubes of 2, 4, 8 and 32 voxels are narrower than 0.7 pixels.
vec4 levels_by_footprint(RayStart start) {
  // 0.7 leaves room for the samples of a pixel, which are half a pixel apart.
  vec4 side = vec4(2.0, 4.0, 8.0, 32.0) / 0.7;
  float grows = params.footprint.y * length(start.ray.direction * params.voxel_size.xyz) /
                params.voxel_size.w;
  float here = params.footprint.x + grows * start.t_skipped;
  if (grows <= 1e-9 * here) return mix(vec4(DDA_FAR), vec4(-1.0), lessThanEqual(side, vec4(here)));
  return (side - here) / grows;
}

Look look_at(vec2 pixel) {
  EyeRay eye = image_ray(pixel);
  if (has(RAYMARCH_HAS_SECTION)) eye = clipped_to_section(eye);
  Look look;
  look.start = dda_start(eye.origin, eye.direction, eye.t_first, eye.t_last, params.box_low.xyz,
                         params.box_high.xyz);
#ifdef RAYMARCH_HITS
  look.level_t = vec4(DDA_FAR);
#else
  look.level_t = levels_by_footprint(look.start);
#endif
  look.from_cut = eye.t_first > 0.0;
  return look;
}

Sight sight_of(Look look, March found) {
  Sight sight;
  sight.start = look.start;
  sight.found = found;
  bool at_start = found.axis < 0;
  sight.on_section = at_start && look.start.axis < 0 && look.from_cut;
  if (at_start) sight.found.axis = look.start.axis;
  return sight;
}

Sight seen(vec2 pixel) {
  Look look = look_at(pixel);
  return sight_of(look, march(march_grid(), look.start.ray, look.start.cell, look.start.t_max,
                              look.level_t, look.start.meets ? params.box_low.w : 0));
}

// The face through which the ray entered; if it began inside, that of the ray's longest axis.
int sight_face(Sight sight) {
  int axis = sight.found.axis;
  if (axis < 0) axis = dda_longest_axis(sight.start.ray.direction);
  return dda_face(sight.start.ray, axis);
}

#ifdef RAYMARCH_HITS

layout(location = 0) out ivec4 out_hit;

void main() {
  Sight sight = seen(gl_FragCoord.xy);
  out_hit = ivec4(sight.found.cell, sight.found.hit ? sight_face(sight) : -1);
}

#else

layout(location = 0) out vec4 out_color;

int pixel_samples() { return params.box_high.w * params.box_high.w; }

vec3 voxel_scale() { return params.voxel_size.xyz / params.voxel_size.w; }

#ifdef RAYMARCH_LANES
// In C++: what pixels share, which is theirs to set.
PixelLanes* lanes = nullptr;
#endif

// The last estimate of this pixel. Other samples that hit the same voxel or an adjacent one use it
// too, because estimating is expensive on software drivers.
ivec3 last_cell = ivec3(-0x10000);
int last_level = 0;
vec3 last_normal = vec3(0.0);

#if RAYMARCH_SMOOTH
vec3 estimated_normal(March found) {
  ivec3 apart = abs((found.cell >> found.level) - last_cell);
  if (any(greaterThan(apart, ivec3(1))) || found.level != last_level) {
    last_cell = found.cell >> found.level;
    last_level = found.level;
#ifdef RAYMARCH_LANES
    last_normal = lanes_normal(*this, found.cell, found.level);
#else
    last_normal = march_estimated_normal(march_grid(), found.cell, found.level, voxel_scale());
#endif
  }
  return last_normal;
}
#endif

vec3 mixed_normal(vec3 normal, vec3 face) {
  return normalize(mix(normal, face, params.light_world.w));
}

// Unit normal towards the eye, stored or estimated. An estimate is mixed with the face's normal if
// voxels are large in the image.
vec3 smooth_normal(March found, vec3 face, vec3 to_eye) {
#if RAYMARCH_ATTRIBUTES
  if (has(RAYMARCH_HAS_NORMAL)) {
    vec3 stored = march_stored_normal(found);
    // Opposite normals of a thin wall may have cancelled out; then the face's is used. Meshes are
    // visible from both sides.
    vec3 normal = dot(stored, stored) > 0.01 ? normalize(stored) : face;
    if (dot(normal, to_eye) < 0.0) normal = -normal;
    // Cubes have faces, and smooth surfaces have their own normals.
    return has(RAYMARCH_HIGHLIGHT) ? normal : mixed_normal(normal, face);
  }
#endif
#if RAYMARCH_SMOOTH
  vec3 estimated = estimated_normal(found);
  if (dot(estimated, estimated) < 0.5) return face;
  return mixed_normal(dot(estimated, to_eye) < 0.0 ? -estimated : estimated, face);
#else
  return face;
#endif
}

// What a hit shows, before light reaches it.
struct Surface {
  vec3 albedo;
  vec3 face, normal, to_eye;  // unit vectors of the world
  float edges;
};

#if RAYMARCH_LIGHT
// Where the light on a hit is sampled, and whether.
struct LightQuery {
  LitPoint point;
  vec3 upward;
  int level;
  bool is_occluded, is_shadowed;
};

// A section's cut face gets all light, because the voxels in front of it are gone.
LightQuery light_query(Sight sight, Surface surface) {
  LightQuery query;
  query.level = sight.found.level;
  query.is_occluded = has(RAYMARCH_OCCLUSION) && sight.found.axis >= 0;
  query.is_shadowed = has(RAYMARCH_SHADOW) && sight.found.axis >= 0 &&
                      dot(surface.normal, params.light_world.xyz) > 0.0;
  // Small voxels stand for a smooth surface, which their steps must not darken. Rays therefore
  // start above them.
  float as_cubes = params.footprint.w;
  // Behind a crest the normal towards the eye may point into the surface.
  vec3 face = surface.face;
  bool is_towards = dot(surface.normal, face) > 0.0;
  query.upward = is_towards ? normalize(mix(surface.normal, face, as_cubes)) : face;
  float offset = 1.5 * (1.0 - as_cubes) * float(1 << query.level);
  query.point =
      light_point(sight.found, sight.start.ray, face, query.upward, offset, voxel_scale());
  if (light_is_blocked(march_grid(), query.point.cell, query.level)) {
    query.upward = face;
    query.point = light_point(sight.found, sight.start.ray, face, face, 0.0, voxel_scale());
  }
  return query;
}

int open_rays() { return max(RAYMARCH_OCCLUSION_RAYS, 4 * pixel_samples()); }
int lit_rays() { return max(RAYMARCH_SHADOW_RAYS, 2 * pixel_samples()); }
vec4 light_cut() { return has(RAYMARCH_HAS_SECTION) ? params.section : vec4(0.0); }

// The light that reaches it, by this sample's rays.
Exposure exposure_of(LightQuery query, int sample_index) {
  Exposure exposure = Exposure(1.0, 1.0);
  int stride = pixel_samples();
  if (query.is_occluded) {
    exposure.open = light_open(march_grid(), query.point, query.upward, voxel_scale(), light_cut(),
                               query.level, params.footprint.z, sample_index, stride, open_rays());
  }
  if (query.is_shadowed) {
    exposure.lit = light_shadow(march_grid(), query.point, params.light_world.xyz,
                                RAYMARCH_LIGHT_RADIUS, voxel_scale(), light_cut(), query.level,
                                sample_index, stride, lit_rays());
  }
  return exposure;
}
#endif

// The share of light that the edges of a cube's face leave at the hit, 0..1.
float edge_light(Sight sight, int face) {
  if (params.tone.z <= 0.0 || sight.found.level > 0 || sight.on_section) return 1.0;
  GridRay ray = sight.start.ray;
  vec3 at = ray.origin + ray.direction * sight.found.t - vec3(sight.found.cell - ray.base);
  vec3 to_edge = min(at, 1.0 - at) * voxel_scale();
  to_edge = mix(to_edge, vec3(1.0), equal(ivec3(face / 2), ivec3(0, 1, 2)));
  float nearest = min(to_edge.x, min(to_edge.y, to_edge.z));
  return 1.0 - params.tone.z * (1.0 - smoothstep(0.3 * params.tone.y, params.tone.y, nearest));
}

Surface surface_of(Sight sight) {
  March found = sight.found;
  Surface surface;
  surface.albedo = SHADING_NEUTRAL;
#if RAYMARCH_ATTRIBUTES
  if (has(RAYMARCH_HAS_COLOR)) {
    vec3 of_full = mix(SHADING_NEUTRAL, params.full_color.rgb, params.full_color.w);
    surface.albedo = with_exposure(march_color(found, of_full), params.tone.x);
  }
#endif
  int face = sight_face(sight);
  surface.face = face_normal(face);
  if (sight.on_section) {
    // A plane's normal scales with the inverse of the scale from grid to world.
    surface.face = normalize(params.section.xyz / params.voxel_size.xyz);
    surface.albedo =
        cut_color(surface.albedo, gl_FragCoord.x + gl_FragCoord.y, params.tone.w);
  }
  surface.edges = edge_light(sight, face);
  surface.to_eye = -normalize(sight.start.ray.direction * params.voxel_size.xyz);
  surface.normal = sight.on_section ? surface.face
                                    : smooth_normal(found, surface.face, surface.to_eye);
  return surface;
}

vec3 lit_color(Surface surface, Exposure exposure) {
  if (!has(RAYMARCH_PHONG)) return surface.albedo * flat_light(surface.face, exposure);
  float gloss = has(RAYMARCH_HIGHLIGHT) ? 1.0 : 0.0;
  return surface.edges * phong_light(surface.albedo, surface.normal, surface.to_eye,
                                     params.light_world.xyz, exposure, gloss);
}

vec3 shade(Sight sight, int sample_index) {
  Surface surface = surface_of(sight);
#if RAYMARCH_LIGHT
  return lit_color(surface, exposure_of(light_query(sight, surface), sample_index));
#else
  return lit_color(surface, Exposure(1.0, 1.0));
#endif
}

#if RAYMARCH_GROUND
// How dark the floor is under a ray that meets nothing, 0..1. It varies little within a pixel, so
// one point of it serves all samples.
float ground_at(vec2 pixel) {
  EyeRay eye = image_ray(pixel);
  double t = (double(params.ground.y) - eye.origin.y) / eye.direction.y;
  if (eye.direction.y >= 0.0 || t <= 0.0) return 0.0;
  dvec3 at = eye.origin + eye.direction * t;
  at.y = double(params.ground.y);
  vec3 from_middle = vec3(at - dvec3(params.ground.xyz)) * voxel_scale();
  float fades = params.ground.w;
  float far = length(from_middle);
  if (far >= 2.0 * fades) return 0.0;
  int rays = max(RAYMARCH_GROUND_RAYS, 4 * pixel_samples());
  vec4 section = has(RAYMARCH_HAS_SECTION) ? params.section : vec4(0.0);
  float darkness = ground_darkness(march_grid(), at, params.light_world.xyz, voxel_scale(),
                                   0.5 * fades, section, rays);
  return darkness * (1.0 - smoothstep(fades, 2.0 * fades, far));
}
#endif

#if RAYMARCH_OUTLINE
// A point of the surface, with what decides whether there is an outline between it and another one.
struct Contour {
  bool hit;
  vec3 position;  // in longest voxel sides
  vec3 normal;
};

Contour contour(vec2 pixel) {
  Sight sight = seen(pixel);
  Contour c;
  c.hit = sight.found.hit;
  c.position = vec3(0.0);
  c.normal = vec3(0.0);
  if (!c.hit) return c;
  GridRay ray = sight.start.ray;
  vec3 to_eye = -normalize(ray.direction * params.voxel_size.xyz);
  c.position = (vec3(ray.base) + ray.origin + ray.direction * sight.found.t) * voxel_scale();
  vec3 face = face_normal(sight_face(sight));
  if (sight.on_section) face = normalize(params.section.xyz / params.voxel_size.xyz);
  c.normal = sight.on_section ? face : smooth_normal(sight.found, face, to_eye);
  return c;
}

// Whether one is in front of the other, or the surface bends between them.
bool is_outline(Contour a, Contour b) {
  if (a.hit != b.hit) return true;
  if (!a.hit) return false;
  vec3 apart = b.position - a.position;
  float off = max(abs(dot(apart, a.normal)), abs(dot(apart, b.normal)));
  return off > params.line.w || dot(a.normal, b.normal) < 0.7;
}

// By the two diagonals of a square of a pixel and a half: Roberts, "Machine perception of
// three-dimensional solids" (1963).
bool has_outline(vec2 pixel) {
  const float r = 0.75;
  return is_outline(contour(pixel + vec2(-r, -r)), contour(pixel + vec2(r, r))) ||
         is_outline(contour(pixel + vec2(-r, r)), contour(pixel + vec2(r, -r)));
}
#endif

// The grid at a position of the image: linear light RGB and 1, or 0 where there is none.
vec4 seen_at(vec2 pixel, int sample_index) {
#if RAYMARCH_OUTLINE
  return has_outline(pixel) ? vec4(params.line.rgb, 1.0) : vec4(0.0);
#else
  Sight sight = seen(pixel);
  return sight.found.hit ? vec4(shade(sight, sample_index), 1.0) : vec4(0.0);
#endif
}

// The position of a sample in the image.
vec2 sample_place(int index) {
  int side = params.box_high.w;
  return floor(gl_FragCoord.xy) + (vec2(index % side, index / side) + 0.5) / float(side);
}

// The sum of a pixel's samples: linear light RGB, and the number of those that meet the grid.
vec4 seen_in_pixel() {
  vec4 sum = vec4(0.0);
  for (int i = 0; i < pixel_samples(); ++i) sum += seen_at(sample_place(i), i);
  return sum;
}

// The samples that meet nothing show the ground.
vec4 with_ground(vec4 sum, float darkness) {
  return sum + (float(pixel_samples()) - sum.a) * vec4(SHADING_SHADOW * darkness, darkness);
}

// The sum over the background, either of which may be transparent, in linear light. The target
// takes straight alpha.
vec4 over_background(vec4 sum) {
  float count = float(pixel_samples());
  float coverage = sum.a / count;
  vec4 behind = mix(params.background, params.background_top,
                    gl_FragCoord.y / float(params.image.y));
  float back = behind.a * (1.0 - coverage);
  float alpha = coverage + back;
  vec3 color = sum.rgb / count + behind.rgb * back;
  return vec4(alpha > 0.0 ? srgb_from_linear(color / alpha) : vec3(0.0), alpha);
}

void main() {
  vec4 sum = seen_in_pixel();
#if RAYMARCH_GROUND
  if (has(RAYMARCH_HAS_GROUND) && sum.a < float(pixel_samples())) {
    sum = with_ground(sum, ground_at(gl_FragCoord.xy));
  }
#endif
  out_color = over_background(sum);
}

#endif
