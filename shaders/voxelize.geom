// Pipeline raster, both passes: rotates the triangle so that it is seen along its dominant axis,
// and dilates it so that every column that it touches gets a fragment. This is conservative
// rasterization (Hasselgren, Akenine-Moller & Ohlsson 2005, GPU Gems 2 chapter 42), with half the
// pixel's diagonal as in the thesis. Fragments are only candidates: the fragment shader clips them
// to the bounding box and tests exactly, so that a driver's rounding does not matter. Each column
// gets at most one fragment per triangle, because a triangle is one primitive, or two that share an
// edge.
#include "shared/voxelize.h"
#include "lib/touch.glsl"

layout(triangles) in;
layout(triangle_strip, max_vertices = 4) out;
layout(std140, binding = VOXELIZE_PARAMS) uniform Params { VoxelizeParams params; };

in Corner {
  flat ivec3 q;
  flat uint triangle;
} corner[3];

flat out uint triangle;
flat out int axis;

// Half the pixel's diagonal, plus a margin far above the rounding of the vertices: that of float
// here (2^-10 of a pixel after the mitre) and that of the rasterizer's grid (1/16 pixel at worst,
// OpenGL 4.5).
const float kReach = 0.70710678 + 0.1;
// Rectangles of at most this many columns are drawn as rectangles; dilation would give as many
// fragments.
const int kSmallColumns = 16;
// Ratio of altitude to longest side below which mitres grow too long. Such slivers are drawn as
// rectangles.
const float kSliver = 0.05;

int chosen_axis;

void emit(vec2 p) {
  triangle = corner[0].triangle;
  axis = chosen_axis;
  gl_Position = vec4(p * (2.0 / float(VOXELIZE_TILE_CELLS)) - 1.0, 0.0, 1.0);
  EmitVertex();
}

// The point near p where the sides along unit vectors `before` and `after`, both moved outwards,
// meet. outward: +1 or -1 by orientation.
vec2 dilated(vec2 p, vec2 before, vec2 after, float outward) {
  vec2 n_before = vec2(before.y, -before.x) * outward;
  vec2 n_after = vec2(after.y, -after.x) * outward;
  return p + kReach * (before / dot(before, n_after) + after / dot(after, n_before));
}

void main() {
  chosen_axis = touch_dominant_axis(corner[0].q, corner[1].q, corner[2].q);
  ivec3 q0 = touch_swizzle(corner[0].q, chosen_axis);
  ivec3 q1 = touch_swizzle(corner[1].q, chosen_axis);
  ivec3 q2 = touch_swizzle(corner[2].q, chosen_axis);
  ivec2 last = touch_swizzle(params.cell_max.xyz, chosen_axis).xy;
  ivec2 cell_min = max(min(q0.xy, min(q1.xy, q2.xy)) >> 8, ivec2(0));
  ivec2 cell_max = min(max(q0.xy, max(q1.xy, q2.xy)) >> 8, last);
  if (any(greaterThan(cell_min, cell_max))) return;
  ivec2 columns = cell_max - cell_min + 1;

  vec2 a = (vec2(q0.xy) + 0.5) / 256.0;
  vec2 b = (vec2(q1.xy) + 0.5) / 256.0;
  vec2 c = (vec2(q2.xy) + 0.5) / 256.0;
  vec2 ab = b - a, bc = c - b, ca = a - c;
  float doubled_area = ab.x * bc.y - ab.y * bc.x;
  float longest_squared = max(dot(ab, ab), max(dot(bc, bc), dot(ca, ca)));
  if (columns.x * columns.y <= kSmallColumns ||
      abs(doubled_area) < kSliver * longest_squared) {
    vec2 low = vec2(cell_min);
    vec2 high = vec2(cell_max + 1);
    emit(low);
    emit(vec2(high.x, low.y));
    emit(vec2(low.x, high.y));
    emit(high);
    EndPrimitive();
    return;
  }
  ab = normalize(ab);
  bc = normalize(bc);
  ca = normalize(ca);
  float outward = doubled_area >= 0.0 ? 1.0 : -1.0;
  emit(dilated(a, ca, ab, outward));
  emit(dilated(b, ab, bc, outward));
  emit(dilated(c, bc, ca, outward));
  EndPrimitive();
}
