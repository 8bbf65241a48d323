// Slice map: fetches one corner of a triangle.
#include "shared/solid.h"

layout(std430, binding = SOLID_TRIANGLES) readonly buffer Triangles { int triangles[]; };

out Corner {
  flat ivec2 q;
  flat uint triangle;
} corner;

void main() {
  uint vertex = uint(gl_VertexID);
  corner.q = ivec2(triangles[vertex * 3u], triangles[vertex * 3u + 1u]);
  corner.triangle = vertex / 3u;
  gl_Position = vec4(0.0, 0.0, 0.0, 1.0);
}
