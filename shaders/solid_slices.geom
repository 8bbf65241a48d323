// Slice map: the triangle as seen along its columns, dilated so that every column whose centre it
// covers gets a fragment. It gets only one, because a triangle is one primitive, or two that share
// an edge. Fragments are candidates: the fragment shader tests exactly.
#include "shared/solid.h"

layout(triangles) in;
layout(triangle_strip, max_vertices = 4) out;
layout(std140, binding = SOLID_PARAMS) uniform Params { SolidParams params; };

in Corner {
  flat ivec2 q;
  flat uint triangle;
} corner[3];

flat out uint triangle;

// The dilation, far above the rounding of the vertices: that of float here, 2^-10 of a pixel after
// the mitre, and that of the rasterizer's grid (1/16 pixel at worst, OpenGL 4.5).
const float kReach = 0.125;
// Rectangles of at most this many columns are drawn as rectangles.
const int kSmallColumns = 16;
// Ratio of altitude to longest side below which mitres grow too long. Such slivers are drawn as
// rectangles.
const float kSliver = 0.05;

void emit(vec2 p) {
  triangle = corner[0].triangle;
  gl_Position = vec4(p * (2.0 / float(SOLID_TILE_CELLS)) - 1.0, 0.0, 1.0);
  EmitVertex();
}

// The point near p where the sides along unit vectors `before` and `after`, both moved outwards,
// meet.
vec2 dilated(vec2 p, vec2 before, vec2 after, float outward) {
  vec2 n_before = vec2(before.y, -before.x) * outward;
  vec2 n_after = vec2(after.y, -after.x) * outward;
  return p + kReach * (before / dot(before, n_after) + after / dot(after, n_before));
}

void main() {
  ivec2 q0 = corner[0].q, q1 = corner[1].q, q2 = corner[2].q;
  ivec2 first = max(min(q0, min(q1, q2)) >> 8, ivec2(0));
  ivec2 last = min(max(q0, max(q1, q2)) >> 8, params.columns.xy);
  if (any(greaterThan(first, last))) return;
  ivec2 columns = last - first + 1;
  vec2 a = (vec2(q0) + 0.5) / 256.0;
  vec2 b = (vec2(q1) + 0.5) / 256.0;
  vec2 c = (vec2(q2) + 0.5) / 256.0;
  vec2 ab = b - a, bc = c - b, ca = a - c;
  float doubled_area = ab.x * bc.y - ab.y * bc.x;
  float longest_squared = max(dot(ab, ab), max(dot(bc, bc), dot(ca, ca)));
  bool is_rectangle = columns.x * columns.y <= kSmallColumns ||
                      abs(doubled_area) < kSliver * longest_squared;
  if (!is_rectangle) {
    ab = normalize(ab);
    bc = normalize(bc);
    ca = normalize(ca);
    float outward = doubled_area >= 0.0 ? 1.0 : -1.0;
    a = dilated(a, ca, ab, outward);
    b = dilated(b, ab, bc, outward);
    c = dilated(c, bc, ca, outward);
    // Clipping by the viewport would give several primitives, with corners that a driver rounds.
    is_rectangle = any(lessThan(min(a, min(b, c)), vec2(0.0))) ||
                   any(greaterThan(max(a, max(b, c)), vec2(SOLID_TILE_CELLS)));
  }
  if (is_rectangle) {
    vec2 low = vec2(first);
    vec2 high = vec2(last + 1);
    emit(low);
    emit(vec2(high.x, low.y));
    emit(vec2(low.x, high.y));
    emit(high);
  } else {
    emit(a);
    emit(b);
    emit(c);
  }
  EndPrimitive();
}
