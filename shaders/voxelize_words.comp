// Pipeline compute on software drivers, for triangles at most 16 voxels wide. An invocation has one
// triangle and goes through the words of its tile's mask that its box reaches. Software drivers
// access memory lane by lane but compute on all lanes at once. A triangle is therefore read by two
// loads, and each word is written at most once.
#define TOUCH_INT int
#define TOUCH_INT3 ivec3
#include "shared/voxelize.h"
#include "lib/touch.glsl"
#include "lib/touch_item.glsl"
#include "lib/touch_mask.glsl"
#include "lib/touch_word.glsl"

layout(local_size_x = VOXELIZE_GROUP_SIZE) in;
layout(std430, binding = VOXELIZE_SMALL) readonly buffer Small { SmallTriangle small_triangles[]; };
layout(std430, binding = VOXELIZE_MASK) buffer Mask { uint mask[]; };
layout(std140, binding = VOXELIZE_PARAMS) uniform Params { VoxelizeParams params; };

int field(uint word, int shift, int bits) { return int(word >> uint(shift)) & ((1 << bits) - 1); }

// Digits that each coordinate has in the number of a 4x4x2 word of the mask. Subtracting such a
// mask and masking again adds one to the coordinate.
#define WORD_X_DIGITS (TILE_MORTON_X >> 5u)
#define WORD_Y_DIGITS (TILE_MORTON_X >> 4u)
#define WORD_Z_DIGITS (TILE_MORTON_X >> 3u)
#define WORDS_PER_TILE_SHIFT 19
uvec3 words_digits(ivec3 word) {
  return uvec3(tile_spread(uint(4 * word.x)) >> 5u, tile_spread(uint(4 * word.y)) >> 4u,
               tile_spread(uint(2 * word.z)) >> 3u);
}

void main() {
  uint groups = (params.item_count + uint(VOXELIZE_GROUP_SIZE) - 1u) / uint(VOXELIZE_GROUP_SIZE);
  uint group = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
  if (group >= groups) return;
  uint index = dealt_group(group, groups) * uint(VOXELIZE_GROUP_SIZE) + gl_LocalInvocationIndex;
  if (index >= params.item_count) return;
  uvec4 corners = small_triangles[index].corners;
  uvec4 place = small_triangles[index].place;
  ivec3 box = ivec3(field(place.y, 0, VOXELIZE_SMALL_CELL_BITS),
                    field(place.y, VOXELIZE_SMALL_CELL_BITS, VOXELIZE_SMALL_CELL_BITS),
                    field(place.y, 2 * VOXELIZE_SMALL_CELL_BITS, VOXELIZE_SMALL_CELL_BITS)) -
              VOXELIZE_SMALL_BIAS;
  ivec3 first = ivec3(field(place.z, 0, 6), field(place.z, VOXELIZE_SMALL_WORD_Y_SHIFT, 6),
                      field(place.z, VOXELIZE_SMALL_WORD_Z_SHIFT, 7));
  ivec3 last = first + ivec3(field(place.z, VOXELIZE_SMALL_COUNT_X_SHIFT, 3),
                             field(place.z, VOXELIZE_SMALL_COUNT_Y_SHIFT, 3),
                             field(place.z, VOXELIZE_SMALL_COUNT_Z_SHIFT, 4));
  ivec3 last_cell =
      ivec3(field(place.w, VOXELIZE_SMALL_SLOT_BITS, VOXELIZE_SMALL_LAST_BITS),
            field(place.w, VOXELIZE_SMALL_SLOT_BITS + VOXELIZE_SMALL_LAST_BITS,
                  VOXELIZE_SMALL_LAST_BITS),
            field(place.w, VOXELIZE_SMALL_SLOT_BITS + 2 * VOXELIZE_SMALL_LAST_BITS,
                  VOXELIZE_SMALL_LAST_BITS));
  uint mask_first = uint(field(place.w, 0, VOXELIZE_SMALL_SLOT_BITS)) << WORDS_PER_TILE_SHIFT;
  TouchTriangle t = touch_setup(ivec3(corners.xyz & 0xffffu), ivec3(corners.xyz >> 16u),
                                ivec3(corners.w & 0xffffu, corners.w >> 16u, place.x), last_cell);
  ivec3 size = last - first + 1;
  ivec3 word = first;
  uvec3 first_digits = words_digits(first);
  uvec3 digits = first_digits;
  // The next word's place is computed before the word. Otherwise LLVM would compute it lane by lane
  // together with the atomic that alone needs it.
  uint at = mask_first | digits.x | digits.y | digits.z;
  for (int n = size.x * size.y * size.z; n > 0; --n) {
    uint bits = touch_word(t, word * ivec3(4, 4, 2) - box);
    if (bits != 0u) atomicOr(mask[at], bits);
    bool next_row = word.x == last.x;
    bool next_layer = next_row && word.y == last.y;
    word.x = next_row ? first.x : word.x + 1;
    digits.x = next_row ? first_digits.x : (digits.x - WORD_X_DIGITS) & WORD_X_DIGITS;
    if (next_row) {
      word.y = next_layer ? first.y : word.y + 1;
      digits.y = next_layer ? first_digits.y : (digits.y - WORD_Y_DIGITS) & WORD_Y_DIGITS;
    }
    if (next_layer) {
      word.z += 1;
      digits.z = (digits.z - WORD_Z_DIGITS) & WORD_Z_DIGITS;
    }
    at = mask_first | digits.x | digits.y | digits.z;
  }
}
