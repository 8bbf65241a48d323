// Pipeline compute: one invocation per work item adds a triangle's attributes to the sums of the
// cells that it touches in a block of columns.
#include "shared/attributes.h"
#include "lib/touch.glsl"
#include "lib/touch_item.glsl"
#include "lib/touch_mask.glsl"
#include "lib/attribute_area.glsl"
#include "lib/attributes.glsl"
#include "lib/attribute_visit.glsl"
#include "lib/touch_columns.glsl"

layout(local_size_x = VOXELIZE_GROUP_SIZE) in;
layout(std430, binding = VOXELIZE_TRIANGLES) readonly buffer Triangles { int triangles[]; };
layout(std430, binding = VOXELIZE_ITEMS) readonly buffer Items { uvec2 items[]; };
layout(std430, binding = VOXELIZE_MASK) readonly buffer Mask { uint mask[]; };
layout(std430, binding = VOXELIZE_ATTRIBUTES) readonly buffer Attributes { uint attributes[]; };
layout(std430, binding = VOXELIZE_WORD_OFFSETS) readonly buffer Offsets { uint word_offsets[]; };
layout(std430, binding = VOXELIZE_SUMS) buffer Sums { uint sums[]; };
layout(std430, binding = ATTRIBUTES_CARRIES) buffer Carries { uint carries[]; };
layout(std140, binding = VOXELIZE_PARAMS) uniform Params { VoxelizeParams params; };
#if ATTRIBUTE_TEXTURE
layout(std430, binding = VOXELIZE_LINEAR) readonly buffer Linear { uint linear_from_srgb[]; };
layout(binding = VOXELIZE_TEXTURE) uniform usampler2D image;

uint linear_from_srgb8(uint value) { return linear_from_srgb[value]; }
uvec4 fetch_texel(ivec2 at, int level) { return texelFetch(image, at, level); }
// textureSize(image, level) is avoided: llvmpipe of Mesa 22.3.6 takes the level of the first
// invocation for its whole SIMD group (seen as wrong texels on triangles of different levels).
ivec2 level_size(int level) { return max(textureSize(image, 0) >> level, ivec2(1)); }
#endif

WorkItem item;

uint attribute_word(int word) {
  return attributes[item.triangle * uint(ATTRIBUTE_WORDS) + uint(word)];
}

bool find_voxel(int i, int j, int k, out uint voxel) {
  uint m = tile_morton(i, j, k, item.axis);
  uint word = mask[m >> 5], bit = 1u << (m & 31u);
  if ((word & bit) == 0u) return false;
  uint below = word & (bit - 1u);
  voxel = word_offsets[m >> 5] + uint(bitCount(below)) - params.voxel_first;
  return voxel < params.voxel_count;
}

void add_to_sum(uint voxel, uint channel, uint value) {
  if (value == 0u) return;
  uint at = voxel * uint(ATTRIBUTE_CHANNELS) + channel;
  if (atomicAdd(sums[at], value) + value < value) {
    atomicAdd(carries[at + 1u], 1u);
    carries[0] = 1u;
  }
}

ivec3 item_vertex(uint corner) {
  uint at = item.triangle * 9u + corner * 3u;
  return touch_swizzle(ivec3(triangles[at], triangles[at + 1u], triangles[at + 2u]), item.axis);
}

void main() {
  uint groups = (params.item_count + uint(VOXELIZE_GROUP_SIZE) - 1u) / uint(VOXELIZE_GROUP_SIZE);
  uint group = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
  if (group >= groups) return;
  uint index = dealt_group(group, groups) * uint(VOXELIZE_GROUP_SIZE) + gl_LocalInvocationIndex;
  if (index >= params.item_count) return;
  item = unpack_item(items[params.item_first + index]);
  ivec3 v0 = item_vertex(0u), v1 = item_vertex(1u), v2 = item_vertex(2u);
  read_attributes(v0, v1, v2);
  ivec3 cell_last = touch_swizzle(params.cell_max.xyz, item.axis);
  visit_block(touch_setup(v0, v1, v2, cell_last), item.first, item.last);
}
