// Parameters and bindings of the ray march pass, read by C++ (server/render) and GLSL.
#ifdef __cplusplus
#pragma once
#endif
#include "shaders/shared/types.h"

// Storage buffers.
#define RAYMARCH_BRICK_INDEX 0   // uint per brick of the grid, x fastest: 0 empty, else number + 1
#define RAYMARCH_BRICK_MASKS 1   // 16 uints per occupied brick, Morton order (proto/sparse_tile.h)
#define RAYMARCH_BRICK_OFFSETS 2 // uint per occupied brick: number of its first voxel
#define RAYMARCH_COLORS 3        // uint per voxel: R | G << 8 | B << 16 | A << 24, sRGB
#define RAYMARCH_NORMALS 4       // uint per voxel: x | y << 8 | z << 16, signed bytes, times 127
#define RAYMARCH_BLOCK_BITS 5    // bit per block of 32^3 voxels, x fastest: 1 where any is occupied
// Uniform buffer.
#define RAYMARCH_PARAMS 0

#define RAYMARCH_BRICK_SHIFT 3  // 8 voxels to a side of a brick
#define RAYMARCH_BLOCK_SHIFT 5  // 32 voxels to a side of a block

// Voxels to each side of a voxel that its normal is estimated from, where the grid has none: 2 is
// the least that tells slopes of 1:5 apart; time grows with the cube of 2n+1.
#define RAYMARCH_NORMAL_RADIUS 2

#define RAYMARCH_HAS_COLOR 1u
#define RAYMARCH_HAS_NORMAL 2u
#define RAYMARCH_HAS_SECTION 4u
#define RAYMARCH_PHONG 8u

VOXELD_SHARED_BEGIN

// All of grid space unless said otherwise: one unit is one voxel, the grid's min corner is the
// origin.
struct RaymarchParams {
  // Homogeneous point of the near (z = -1) and far (z = 1) plane under clip position x, y:
  // at_0 + x * at_x + y * at_y.
  vec4 near_0, near_x, near_y;
  vec4 far_0, far_x, far_y;
  vec4 section;      // plane a,b,c,d: what has a*x+b*y+c*z+d > 0 is cut away
  vec4 voxel_size;   // world units per voxel, xyz; w: the largest of the three
  vec4 light_world;  // unit vector towards the key light; w: share of the face in estimated normals
  vec4 background;   // linear light RGB, straight alpha
  ivec4 dims;        // voxels xyz; w: most steps that one ray can take
  ivec4 brick_dims;  // bricks xyz; w: samples along each side of a pixel, 1 or more
  ivec4 block_dims;  // blocks xyz; w unused
  ivec4 picture;     // x, y: pixels; z: RAYMARCH_HAS_COLOR and so on; w unused
};

VOXELD_SHARED_END

#ifdef __cplusplus
static_assert(offsetof(voxeld::shared::RaymarchParams, far_0) == 48);
static_assert(offsetof(voxeld::shared::RaymarchParams, section) == 96);
static_assert(offsetof(voxeld::shared::RaymarchParams, dims) == 160);
static_assert(sizeof(voxeld::shared::RaymarchParams) == 224);
#endif
