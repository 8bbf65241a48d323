// Adds a triangle's attributes to the sums of every cell that it touches: the visitor of
// lib/touch_columns.glsl for the attribute passes of both pipelines. ATTRIBUTE_COLOR,
// ATTRIBUTE_ALPHA, ATTRIBUTE_NORMAL and ATTRIBUTE_TEXTURE, each 0 or 1, choose the channels. Their
// order is weight, colour R G B, alpha, normal X Y Z.
#define ATTRIBUTE_CHANNELS \
  (1 + 3 * ATTRIBUTE_COLOR + ATTRIBUTE_COLOR * ATTRIBUTE_ALPHA + 3 * ATTRIBUTE_NORMAL)

// The including file defines these.
uint attribute_word(int word);                          // of the current triangle
bool find_voxel(int i, int j, int k, out uint voxel);   // false: in another window, or not occupied
void add_to_sum(uint voxel, uint channel, uint value);
uint linear_from_srgb8(uint value);                     // 16 bits
uvec4 fetch_texel(ivec2 at, int level);
ivec2 level_size(int level);

// Attributes of the current triangle. They are read once, because it is visited cell by cell.
AttributeTriangle visited;
uint visited_flags;
uvec4 corner_color0, corner_color1, corner_color2;
uvec3 corner_normal0, corner_normal1, corner_normal2;
ivec2 corner_uv0, corner_uv1, corner_uv2;
uint visited_altitude;
uint visited_weight;

ColumnRows in_column;
int64_t column_depth;

void begin_column(TouchTriangle t, int i, int j) {
  in_column = triangle_rows(visited, i, j);
  column_depth = column_depth_at(visited, i, j);
}

#if ATTRIBUTE_TEXTURE
uvec4 linear_texel(ivec2 at, int level) {
  uvec4 texel = fetch_texel(at, level);
  uvec4 linear = uvec4(linear_from_srgb8(texel.x), linear_from_srgb8(texel.y),
                       linear_from_srgb8(texel.z), texel.w * 257u);
#if ATTRIBUTE_ALPHA
  // Multiplied by alpha, as the corners' colours are: means are then weighted by it.
  linear.x = product16(linear.x, linear.w);
  linear.y = product16(linear.y, linear.w);
  linear.z = product16(linear.z, linear.w);
#endif
  return linear;
}

// Bilinear sample in linear light. The fraction has 8 bits on each axis, so that 65535 * 65536
// fits. A level finer than asked for has its four texels averaged, because single ones would be
// chosen by where taps happen to be.
uvec4 sample_tap(ivec3 weights, int level_max) {
  int level = tap_level(weights, visited_altitude, level_max);
  uint wrap_u = (visited_flags >> ATTRIBUTE_WRAP_U_SHIFT) & 3u;
  uint wrap_v = (visited_flags >> ATTRIBUTE_WRAP_V_SHIFT) & 3u;
  ivec2 size = level_size(level);
  int u = level_coordinate(blend_uv(corner_uv0.x, corner_uv1.x, corner_uv2.x, weights), size.x,
                           wrap_u);
  int v = level_coordinate(blend_uv(corner_uv0.y, corner_uv1.y, corner_uv2.y, weights), size.y,
                           wrap_v);
  int x0 = wrap_texel(u >> 8, size.x, wrap_u), x1 = wrap_texel((u >> 8) + 1, size.x, wrap_u);
  int y0 = wrap_texel(v >> 8, size.y, wrap_v), y1 = wrap_texel((v >> 8) + 1, size.y, wrap_v);
  bool is_finer = level < level_max;
  uint fx = is_finer ? 128u : uint(u & 255), fy = is_finer ? 128u : uint(v & 255);
  uvec4 sum = linear_texel(ivec2(x0, y0), level) * ((256u - fx) * (256u - fy)) +
              linear_texel(ivec2(x1, y0), level) * (fx * (256u - fy)) +
              linear_texel(ivec2(x0, y1), level) * ((256u - fx) * fy) +
              linear_texel(ivec2(x1, y1), level) * (fx * fy);
  return sum >> 16;
}

// True if one tap suffices for a place as large as a texel of `level`: with texels half as large,
// bilinear sampling still covers it.
bool tap_fits(ivec3 weights, int level) {
  return tap_level(weights, visited_altitude, level) + 1 >= level;
}

// The mean over a part of a strip: one tap at its centre if that suffices, else one on each side.
uvec4 sample_half(ivec2 centre, ivec2 spread, uint area, int i, int j, int level_max) {
  int level = part_level(area, level_max);
  ivec3 weights = weights_in_column(visited, i, j, centre);
  if (tap_fits(weights, level)) return sample_tap(weights, level);
  ivec3 left = weights_in_column(visited, i, j, centre - spread);
  ivec3 right = weights_in_column(visited, i, j, centre + spread);
  return (sample_tap(left, level - 1) + sample_tap(right, level - 1) + 1u) >> 1;
}

// The sum of the means over the left and over the right halves of a strip's rows.
uvec4 sample_strip(CellArea cell, RowSums sums, int i, int j, int level_max) {
  ivec2 centre = row_centroid(cell, sums);
  int spread = row_spread(sums);
  uint half_area = rows_area(cell, sums) >> 1;
  ivec2 inner = ivec2(spread >> 1, 0);
  return sample_half(centre - ivec2(spread, 0), inner, half_area, i, j, level_max) +
         sample_half(centre + ivec2(spread, 0), inner, half_area, i, j, level_max);
}

// The mean over the intersection of a triangle and a cell: one tap if that suffices, else the
// mean over its strips, weighted by area. sums: of all rows.
uvec4 sample_texture(ivec3 weights, int i, int j, CellArea cell, RowSums sums) {
  int level_max = int(visited_flags >> ATTRIBUTE_LEVEL_SHIFT) & 15;
  if (sums.lengths == 0u) return sample_tap(weights, level_max);
  int level = part_level(rows_area(cell, sums), level_max);
  if (tap_fits(weights, level)) return sample_tap(weights, level);
  uint done = 0u;
  uvec4 sum = uvec4(1u << 15);
  for (int n = 0; n < AREA_STRIPS; ++n) {
    uint part = cell.strips[n].lengths;
    uint share = length_share(done + part, sums.lengths) - length_share(done, sums.lengths);
    done += part;
    if (share != 0u) sum += sample_strip(cell, cell.strips[n], i, j, level_max) * share;
  }
  return sum >> 16;
}
#endif

void add_color(uint voxel, uint weight, ivec3 weights, int i, int j, CellArea cell, RowSums sums) {
  uvec3 w = weights15(weights);
  uvec4 color = (corner_color0 * w.x + corner_color1 * w.y + corner_color2 * w.z) >> 15;
#if ATTRIBUTE_TEXTURE
  if (((visited_flags >> ATTRIBUTE_FLAT_SHIFT) & 1u) == 0u) {
    uvec4 texel = sample_texture(weights, i, j, cell, sums);
    color = uvec4(product16(color.x, texel.x), product16(color.y, texel.y),
                  product16(color.z, texel.z), product16(color.w, texel.w));
  }
#endif
  add_to_sum(voxel, 1u, weight * color.x);
  add_to_sum(voxel, 2u, weight * color.y);
  add_to_sum(voxel, 3u, weight * color.z);
#if ATTRIBUTE_ALPHA
  add_to_sum(voxel, 4u, weight * color.w);
#endif
}

void add_normal(uint voxel, uint weight, ivec3 weights) {
  uvec3 w = weights15(weights);
  uvec3 normal = (corner_normal0 * w.x + corner_normal1 * w.y + corner_normal2 * w.z) >> 15;
  uint first = uint(ATTRIBUTE_CHANNELS) - 3u;
  add_to_sum(voxel, first, weight * normal.x);
  add_to_sum(voxel, first + 1u, weight * normal.y);
  add_to_sum(voxel, first + 2u, weight * normal.z);
}

void visit_cell(int i, int j, int k) {
  uint voxel;
  if (!find_voxel(i, j, k, voxel)) return;
  CellArea cell = cell_area(visited, in_column, column_depth, k);
  RowSums sums = all_rows(cell);
  uint weight = visited_weight != 0u ? visited_weight : area_weight(visited, rows_area(cell, sums));
  ivec3 weights = corner_weights(visited, sample_position(visited, i, j, cell, sums));
  add_to_sum(voxel, 0u, weight);
#if ATTRIBUTE_COLOR
  add_color(voxel, weight, weights, i, j, cell, sums);
#endif
#if ATTRIBUTE_NORMAL
  add_normal(voxel, weight, weights);
#endif
}

uvec4 read_color(int word) {
  uint rg = attribute_word(word), ba = attribute_word(word + 1);
  return uvec4(rg & 0xffffu, rg >> 16, ba & 0xffffu, ba >> 16);
}
uvec3 read_normal(int word) { return read_color(word).xyz; }
ivec2 read_uv(int word) { return ivec2(int(attribute_word(word)), int(attribute_word(word + 1))); }

// Reads the words of the current triangle. v: corners, swizzled.
void read_attributes(ivec3 v0, ivec3 v1, ivec3 v2) {
  visited_flags = attribute_word(ATTRIBUTE_FLAGS);
  visited_weight = attribute_word(ATTRIBUTE_WEIGHT);
  int64_t reciprocal = int64_t(attribute_word(ATTRIBUTE_RECIPROCAL)) |
                       (int64_t(attribute_word(ATTRIBUTE_RECIPROCAL + 1)) << 32);
  visited = attribute_setup(v0, v1, v2, int(attribute_word(ATTRIBUTE_SLOPE_I)),
                            int(attribute_word(ATTRIBUTE_SLOPE_J)), reciprocal, visited_flags);
#if ATTRIBUTE_COLOR
  corner_color0 = read_color(ATTRIBUTE_COLORS);
  corner_color1 = read_color(ATTRIBUTE_COLORS + 2);
  corner_color2 = read_color(ATTRIBUTE_COLORS + 4);
#endif
#if ATTRIBUTE_NORMAL
  corner_normal0 = read_normal(ATTRIBUTE_NORMALS);
  corner_normal1 = read_normal(ATTRIBUTE_NORMALS + 2);
  corner_normal2 = read_normal(ATTRIBUTE_NORMALS + 4);
#endif
#if ATTRIBUTE_TEXTURE
  corner_uv0 = read_uv(ATTRIBUTE_UVS);
  corner_uv1 = read_uv(ATTRIBUTE_UVS + 2);
  corner_uv2 = read_uv(ATTRIBUTE_UVS + 4);
  visited_altitude = attribute_word(ATTRIBUTE_ALTITUDE);
#endif
}
