// Pipeline raster, both passes: fetches one corner of a triangle.
#include "shared/voxelize.h"

layout(std430, binding = VOXELIZE_TRIANGLES) readonly buffer Triangles { int triangles[]; };
layout(std140, binding = VOXELIZE_PARAMS) uniform Params { VoxelizeParams params; };

out Corner {
  flat ivec3 q;
  flat uint triangle;
} corner;

void main() {
  uint vertex = params.triangle_first * 3u + uint(gl_VertexID);
  corner.q = 
      ivec3(triangles[vertex * 3u], triangles[vertex * 3u + 1u], triangles[vertex * 3u + 2u]);
  corner.triangle = vertex / 3u;
  gl_Position = vec4(0.0, 0.0, 0.0, 1.0);
}
