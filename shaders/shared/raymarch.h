// Parameters, tables and bindings of the ray march pass, read by C++ (server/render) and GLSL.
#ifdef __cplusplus
#pragma once
#endif
#include "shaders/shared/types.h"

// Storage buffers.
#define RAYMARCH_NODES 0    // uint: tables of the tree, see below
#define RAYMARCH_BRICKS 1   // RAYMARCH_BRICK_WORDS uints per occupied brick, see below
#define RAYMARCH_COLORS 2   // uint per voxel: R | G << 8 | B << 16 | A << 24, sRGB
#define RAYMARCH_NORMALS 3  // uint per voxel: x | y << 8 | z << 16, signed bytes, times 127
// Uniform buffer.
#define RAYMARCH_PARAMS 0

// The tree has four levels: the grid is an array of tiles of 256^3 cells, a tile of blocks of 32^3,
// a block of bricks of 8^3, a brick of cells. Tables stand in one buffer, entries x fastest:
//
//   offset            entries
//   0                 tile_dims.x * tile_dims.y * tile_dims.z, the tiles of the grid
//   of each tile      8 * 8 * 8, its blocks
//   of each block     4 * 4 * 4, its bricks; then the means of colour and normal of its voxels,
//                     0 if all of these are in full bricks
//
// Only tiles and blocks that are neither empty nor full have tables, so memory grows with the
// occupied bricks, but for 4 bytes per tile.
//
// An entry: 31 30 29 ...   0
//            1 offset of a table, or the number of a brick
//            0  1              every cell is occupied
//            0  0  0 ... shift every cell of the aligned cube of 2^shift cells around it is empty;
//                              the cube may reach over several entries
#define RAYMARCH_CHILD 0x80000000u
#define RAYMARCH_FULL 0x40000000u
#define RAYMARCH_TILE_SHIFT 8
#define RAYMARCH_BLOCK_SHIFT 5
#define RAYMARCH_BRICK_SHIFT 3
#define RAYMARCH_TILE_ENTRIES 512
#define RAYMARCH_BLOCK_ENTRIES 64
#define RAYMARCH_BLOCK_COLOR 64  // words after the block's entries
#define RAYMARCH_BLOCK_NORMAL 65
#define RAYMARCH_BLOCK_WORDS 66

// A brick: the mask in Morton order (proto/codec/sparse_tile.h), then these.
#define RAYMARCH_BRICK_FIRST 16   // number of its first voxel
#define RAYMARCH_BRICK_NODES 17   // bit i: any voxel in mask words 2i and 2i+1, a cube of 4^3
#define RAYMARCH_BRICK_COLOR 18   // mean, in the form of RAYMARCH_COLORS
#define RAYMARCH_BRICK_NORMAL 19  // mean, in the form of RAYMARCH_NORMALS
#define RAYMARCH_BRICK_WORDS 20

// The largest share of the face in an estimated normal, at voxels of 8 pixels and more.
#define RAYMARCH_FACE_SHARE 0.6f
// The same in style voxel, where large voxels are cubes.
#define RAYMARCH_CUBE_FACE_SHARE 1.0f
#define RAYMARCH_LIGHT_RADIUS 0.04f  // radius as a fraction of the light's distance: 2.3 degrees
#define RAYMARCH_OCCLUSION_RAYS 16   // per pixel, shared by its samples; at least 4 per sample
#define RAYMARCH_SHADOW_RAYS 8       // per pixel, shared by its samples; at least 2 per sample
#define RAYMARCH_GROUND_RAYS 24      // likewise, for each of light and occlusion of the ground
#define RAYMARCH_GROUND_LIGHT_RADIUS 0.10f  // softer than on the grid
// Steps after which a secondary ray counts as meeting nothing.
#define RAYMARCH_OCCLUSION_STEPS 64
#define RAYMARCH_SHADOW_STEPS 512

#define RAYMARCH_HAS_COLOR 1u
#define RAYMARCH_HAS_NORMAL 2u
#define RAYMARCH_HAS_SECTION 4u
#define RAYMARCH_PHONG 8u  // else light that depends on the face alone
#define RAYMARCH_OCCLUSION 16u
#define RAYMARCH_SHADOW 32u
#define RAYMARCH_HIGHLIGHT 64u
#define RAYMARCH_HAS_GROUND 128u

VOXELD_SHARED_BEGIN

// Parameters of an image. Everything is in grid space unless said otherwise: one unit is one voxel,
// and the grid's min corner is the origin. Values from which rays start have twice the digits of a
// float: the value is the member plus the one with suffix _low.
struct RaymarchParams {
  // Homogeneous point of the near (z = -1) and far (z = 1) plane under clip position x, y:
  // at_0 + x * at_x + y * at_y.
  vec4 near_0, near_x, near_y;
  vec4 far_0, far_x, far_y;
  vec4 section;  // plane a,b,c,d: points with a*x+b*y+c*z+d > 0 are cut away
  vec4 near_0_low, near_x_low, near_y_low;
  vec4 far_0_low, far_x_low, far_y_low;
  vec4 section_low;
  vec4 voxel_size;   // sides of a voxel in any unit, xyz; w: the largest of the three
  vec4 light_world;  // unit vector towards the key light; w: share of the face in shaded normals
  vec4 background;   // linear light RGB, straight alpha, at the image's lower edge
  vec4 background_top;  // at its upper edge
  vec4 line;            // linear light RGB of outlines; w: distance of two points from each other's
                        // tangent plane, in voxels, from which there is an outline between them
  vec4 full_color;   // linear light RGB of voxels in full nodes, which have no colours; w: share
                     // of it, 0 or 1, the rest is neutral
  // Voxels (of the largest side) that a pixel spans: x at the near plane, plus y per voxel of
  // distance from it. z: length of ambient occlusion rays in voxels; w: 1 if voxels are drawn as
  // cubes, 0 if they stand for a smooth surface, or in between.
  vec4 footprint;
  // x: factor of dark colours; y: width of the edges of faces in voxels; z: share of light that the
  // edges lose, 0..1; w: distance of the lines of a section's hatch in pixels.
  vec4 tone;
  // The floor: x, z of its middle, in cells; y: its height; w: the distance from the middle, in
  // voxels, at which it begins to fade. It ends at twice that.
  vec4 ground;
  ivec4 box_low;    // cells [box_low, box_high) hold all voxels, xyz; w: the most steps of a ray
  ivec4 box_high;   // w: samples along each side of a pixel, 1 or more
  ivec4 tile_dims;  // tiles of the grid, xyz; w unused
  ivec4 image;      // x, y: pixels; z: RAYMARCH_HAS_COLOR and so on; w unused
};

VOXELD_SHARED_END

#ifdef __cplusplus
static_assert(offsetof(voxeld::shared::RaymarchParams, far_0) == 48);
static_assert(offsetof(voxeld::shared::RaymarchParams, section) == 96);
static_assert(offsetof(voxeld::shared::RaymarchParams, voxel_size) == 224);
static_assert(offsetof(voxeld::shared::RaymarchParams, box_low) == 368);
static_assert(sizeof(voxeld::shared::RaymarchParams) == 432);
#endif
