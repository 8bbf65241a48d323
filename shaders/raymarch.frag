// Ray march through a sparse grid: a two-level DDA over blocks of 32^3, bricks of 8^3 and voxels.
// With RAYMARCH_HITS the pass answers which voxel each pixel's ray hits first; otherwise it draws.
//
// One flat loop per ray: every iteration is one step of whatever size, so a SIMD group takes as
// many as its longest ray, and dims.w bounds that by construction (workaround
// loop_iterations_65535).
#include "lib/dda.glsl"
#include "lib/dda_brick.glsl"
#include "lib/dda_normal.glsl"
#include "lib/shading.glsl"
#include "shared/raymarch.h"

layout(std140, binding = RAYMARCH_PARAMS) uniform Params { RaymarchParams params; };
layout(std430, binding = RAYMARCH_BRICK_INDEX) readonly buffer BrickIndex { uint brick_index[]; };
layout(std430, binding = RAYMARCH_BRICK_MASKS) readonly buffer BrickMasks { uint brick_masks[]; };
layout(std430, binding = RAYMARCH_BLOCK_BITS) readonly buffer BlockBits { uint block_bits[]; };

struct March {
  bool hit;
  bool on_section;  // the ray starts on the section plane, inside the voxel
  ivec3 cell;
  int face;
  uint brick;
};

int linear_index(ivec3 p, ivec3 dims) { return p.x + dims.x * (p.y + dims.y * p.z); }

// log2 of the side of the largest aligned empty cube around the cell that the tables know of, or -1
// where the voxel is occupied; then `brick` is its brick's number.
int empty_shift(ivec3 cell, out uint brick) {
  brick = 0u;
  int block = linear_index(cell >> RAYMARCH_BLOCK_SHIFT, params.block_dims.xyz);
  if ((block_bits[block >> 5] >> (block & 31) & 1u) == 0u) return RAYMARCH_BLOCK_SHIFT;
  uint entry = brick_index[linear_index(cell >> RAYMARCH_BRICK_SHIFT, params.brick_dims.xyz)];
  if (entry == 0u) return RAYMARCH_BRICK_SHIFT;
  brick = entry - 1u;
  int bit = dda_brick_bit(cell.x, cell.y, cell.z);
  return (brick_masks[brick * 16u + uint(bit >> 5)] >> (bit & 31) & 1u) != 0u ? -1 : 0;
}

// The part of the ray on the kept side of the section plane.
void clip_to_section(GridRay ray, inout float t_min, inout float t_max) {
  float at_origin = dot(params.section.xyz, ray.origin) + params.section.w;
  float per_t = dot(params.section.xyz, ray.direction);
  float t = -at_origin / per_t;
  if (per_t == 0.0) {
    if (at_origin > 0.0) t_max = -DDA_FAR;
  } else if (per_t < 0.0) {
    t_min = max(t_min, t);
  } else {
    t_max = min(t_max, t);
  }
}

March march(GridRay ray, float t_max) {
  March result = March(false, false, ivec3(-1), -1, 0u);
  float t = 0.0;
  if ((uint(params.picture.z) & RAYMARCH_HAS_SECTION) != 0u) clip_to_section(ray, t, t_max);
  bool starts_on_section = t > 0.0;
  int axis;
  if (!dda_enter_grid(ray, params.dims.xyz, t, axis) || t > t_max) return result;
  ivec3 cell = dda_first_cell(ray, params.dims.xyz, t, axis);
  result.on_section = starts_on_section && axis < 0;
  if (axis < 0) axis = dda_longest_axis(ray.direction);
  for (int step_count = 0; step_count < params.dims.w; ++step_count) {
    int shift = empty_shift(cell, result.brick);
    if (shift < 0) {
      result.hit = true;
      result.cell = cell;
      result.face = dda_face(ray, axis);
      return result;
    }
    t = dda_leave_block(ray, shift, cell, axis);
    result.on_section = false;
    if (t > t_max || any(lessThan(cell, ivec3(0))) ||
        any(greaterThanEqual(cell, params.dims.xyz))) {
      return result;
    }
  }
  return result;
}

// The ray through a position of the picture in pixels, and where it meets the far plane. From
// homogeneous points, so a far plane at infinity works.
GridRay picture_ray(vec2 pixel, out float t_max) {
  vec2 at = pixel / vec2(params.picture.xy) * 2.0 - 1.0;
  vec4 near = params.near_0 + at.x * params.near_x + at.y * params.near_y;
  vec4 far = params.far_0 + at.x * params.far_x + at.y * params.far_y;
  vec3 direction = far.xyz * near.w - near.xyz * far.w;
  float weight = far.w * near.w;
  if (weight < 0.0) direction = -direction;
  vec3 size = abs(direction);
  float longest = max(size.x, max(size.y, size.z));
  t_max = weight == 0.0 ? DDA_FAR : longest / abs(weight);
  return dda_ray(near.xyz / near.w, direction / longest);
}

#ifdef RAYMARCH_HITS

layout(location = 0) out ivec4 out_hit;

void main() {
  float t_max;
  GridRay ray = picture_ray(gl_FragCoord.xy, t_max);
  March found = march(ray, t_max);
  out_hit = ivec4(found.cell, found.face);
}

#else

layout(std430, binding = RAYMARCH_BRICK_OFFSETS) readonly buffer BrickOffsets {
  uint brick_offsets[];
};
layout(std430, binding = RAYMARCH_COLORS) readonly buffer Colors { uint colors[]; };
layout(std430, binding = RAYMARCH_NORMALS) readonly buffer Normals { uint normals[]; };

layout(location = 0) out vec4 out_color;

// Number of the voxel in storage order: its brick's first, plus how many bits of the mask stand
// before its own.
uint voxel_number(uint brick, ivec3 cell) {
  int bit = dda_brick_bit(cell.x, cell.y, cell.z);
  uint count = brick_offsets[brick];
  for (int word = 0; word < 16; ++word) {
    uint partial = word == (bit >> 5) ? (1u << (bit & 31)) - 1u : 0u;
    uint before = word < (bit >> 5) ? 0xffffffffu : partial;
    count += uint(bitCount(brick_masks[brick * 16u + uint(word)] & before));
  }
  return count;
}

bool is_occupied(ivec3 cell) {
  if (any(lessThan(cell, ivec3(0))) || any(greaterThanEqual(cell, params.dims.xyz))) return false;
  uint entry = brick_index[linear_index(cell >> RAYMARCH_BRICK_SHIFT, params.brick_dims.xyz)];
  if (entry == 0u) return false;
  int bit = dda_brick_bit(cell.x, cell.y, cell.z);
  return (brick_masks[(entry - 1u) * 16u + uint(bit >> 5)] >> (bit & 31) & 1u) != 0u;
}

// Direction of the surface through the cell, from the occupied voxels of its neighbourhood; zero
// where they form no surface. World space, either side.
vec3 estimated_normal(ivec3 cell) {
  const int kRadius = RAYMARCH_NORMAL_RADIUS, kSide = 2 * kRadius + 1;
  float count = 0.0;
  vec3 sum = vec3(0.0), squares = vec3(0.0), products = vec3(0.0);
  for (int i = 0; i < kSide * kSide * kSide; ++i) {
    ivec3 offset = ivec3(i % kSide, i / kSide % kSide, i / (kSide * kSide)) - kRadius;
    if (is_occupied(cell + offset)) {
      vec3 p = vec3(offset) * params.voxel_size.xyz / params.voxel_size.w;
      count += 1.0;
      sum += p;
      squares += p * p;
      products += p.xxy * p.yzz;
    }
  }
  return thinnest_direction(count, sum, squares, products);
}

// The last estimate of this pixel. Its other samples that hit the same voxel or one next to it take
// the same: estimating is the most expensive part of a picture on software drivers.
ivec3 last_cell = ivec3(-0x10000);
vec3 last_normal = vec3(0.0);

// Estimated, towards the eye, and nearer to the face's where voxels are large in the picture.
vec3 smooth_normal(ivec3 cell, vec3 face, vec3 to_eye) {
  if (any(greaterThan(abs(cell - last_cell), ivec3(1)))) {
    last_cell = cell;
    last_normal = estimated_normal(cell);
  }
  if (dot(last_normal, last_normal) < 0.5) return face;
  vec3 normal = dot(last_normal, to_eye) < 0.0 ? -last_normal : last_normal;
  return normalize(mix(normal, face, params.light_world.w));
}

vec3 shade(March found, GridRay ray) {
  uint flags = uint(params.picture.z);
  uint voxel = voxel_number(found.brick, found.cell);
  vec3 albedo = (flags & RAYMARCH_HAS_COLOR) != 0u
                    ? linear_from_srgb(unpackUnorm4x8(colors[voxel]).rgb)
                    : SHADING_NEUTRAL;
  vec3 normal = face_normal(found.face);
  if (found.on_section) {
    // A plane's normal goes with the inverse of the scale from grid to world.
    normal = normalize(params.section.xyz / params.voxel_size.xyz);
  }
  if ((flags & RAYMARCH_PHONG) == 0u) return albedo * flat_light(normal);
  vec3 to_eye = -normalize(ray.direction * params.voxel_size.xyz);
  if (found.on_section) return phong_light(albedo, normal, to_eye, params.light_world.xyz);
  if ((flags & RAYMARCH_HAS_NORMAL) == 0u) {
    normal = smooth_normal(found.cell, normal, to_eye);
  } else {
    vec3 stored = unpackSnorm4x8(normals[voxel]).xyz;
    // Opposite normals of a thin wall may have cancelled out: then the face's serves.
    if (dot(stored, stored) > 0.01) normal = normalize(stored);
    if (dot(normal, to_eye) < 0.0) normal = -normal;  // meshes are seen from both sides
  }
  return phong_light(albedo, normal, to_eye, params.light_world.xyz);
}

void main() {
  int side = params.brick_dims.w;
  vec3 sum = vec3(0.0);
  float hits = 0.0;
  for (int i = 0; i < side * side; ++i) {
    vec2 offset = (vec2(i % side, i / side) + 0.5) / float(side);
    float t_max;
    GridRay ray = picture_ray(floor(gl_FragCoord.xy) + offset, t_max);
    March found = march(ray, t_max);
    if (found.hit) {
      sum += shade(found, ray);
      hits += 1.0;
    }
  }
  // Grid over background, both opaque or not, in linear light; the target takes straight alpha.
  float coverage = hits / float(side * side);
  float back = params.background.a * (1.0 - coverage);
  float alpha = coverage + back;
  vec3 color = sum / float(side * side) + params.background.rgb * back;
  out_color = vec4(alpha > 0.0 ? srgb_from_linear(color / alpha) : vec3(0.0), alpha);
}

#endif
