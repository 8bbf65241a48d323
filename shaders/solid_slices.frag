// Slice map: the fragment of a column flips all cells above the triangle's crossing, by the logical
// operation XOR of the framebuffer (Eisemann & Decoret 2008).
#include "shared/solid.h"
#include "lib/crossings.glsl"

layout(std430, binding = SOLID_TRIANGLES) readonly buffer Triangles { int triangles[]; };
layout(std140, binding = SOLID_PARAMS) uniform Params { SolidParams params; };

flat in uint triangle;
layout(location = 0) out uvec4 low;
layout(location = 1) out uvec4 high;

ivec3 triangle_corner(uint corner) {
  uint at = triangle * 9u + corner * 3u;
  return 2 * ivec3(triangles[at], triangles[at + 1u], triangles[at + 2u]) + 1;
}

uint cells_above(int cell, int word) {
  int shift = cell - 32 * word;
  return shift <= 0 ? ~0u : (shift >= 32 ? 0u : ~0u << shift);
}

void main() {
  ColumnTriangle t = crossing_setup(triangle_corner(0u), triangle_corner(1u), triangle_corner(2u));
  ivec2 column = ivec2(gl_FragCoord.xy);
  if (any(greaterThan(column, params.columns.xy))) discard;
  if (!crossing_inside(t, column.x, column.y)) discard;
  int cell = crossing_first_cell(t, column.x, column.y);
  if (cell > params.cell_last || (cell < 0 && params.is_lowest == 0)) discard;
  low = uvec4(cells_above(cell, 0), cells_above(cell, 1), cells_above(cell, 2),
              cells_above(cell, 3));
  high = uvec4(cells_above(cell, 4), cells_above(cell, 5), cells_above(cell, 6),
               cells_above(cell, 7));
}
