// The attribute pass: the words of a triangle and the channels of the sums, for C++ (server/voxel)
// and GLSL. server/voxel/README.md defines the numbers.
#ifdef __cplusplus
#pragma once
#endif
#include "shaders/shared/voxelize.h"

// The words of one triangle. Corners 0..2 are in ascending order of position.
#define ATTRIBUTE_SLOPE_I 0     // int: depth of the plane per column in i, 2^-24 cells
#define ATTRIBUTE_SLOPE_J 1     // int: the same in j
#define ATTRIBUTE_RECIPROCAL 2  // 64 bits, low word first: floor(2^57 / area), see the README
#define ATTRIBUTE_FLAGS 4       // ATTRIBUTE_FACTOR_MASK and so on
#define ATTRIBUTE_COLORS 5      // per corner R | G << 16 and B | A << 16: linear light, 16 bits
#define ATTRIBUTE_UVS 11        // per corner u, v: int, 2^-ATTRIBUTE_UV_BITS of the texture's side
#define ATTRIBUTE_NORMALS 17    // per corner X | Y << 16 and Z: n * 32767 + 32768
#define ATTRIBUTE_ALTITUDE 23   // the triangle's least altitude in the texture, see the README
// Weight of a triangle within one cell; 0: the area in each cell counts.
#define ATTRIBUTE_WEIGHT 24
#define ATTRIBUTE_WORDS 25

// Flags: bits 0..8 the area factor, 256 |n| / |n_dominant|, 0 for triangles without area;
// bits 9..10 the form of the weights; 11..12 and 13..14 wrapping in u and v; 15..18 the coarsest
// level of the texture, counted from the first that is uploaded; 19: flat, the corners have one
// colour, texture included, and one normal.
#define ATTRIBUTE_FACTOR_MASK 511
#define ATTRIBUTE_FORM_SHIFT 9
#define ATTRIBUTE_WRAP_U_SHIFT 11
#define ATTRIBUTE_WRAP_V_SHIFT 13
#define ATTRIBUTE_LEVEL_SHIFT 15
#define ATTRIBUTE_FLAT_SHIFT 19

// Forms: by area, or along the longest side between two corners.
#define ATTRIBUTE_FORM_AREA 0
#define ATTRIBUTE_FORM_01 1
#define ATTRIBUTE_FORM_02 2
#define ATTRIBUTE_FORM_12 3

#define ATTRIBUTE_WRAP_REPEAT 0
#define ATTRIBUTE_WRAP_CLAMP 1
#define ATTRIBUTE_WRAP_MIRROR 2

#define ATTRIBUTE_DEPTH_BITS 24   // fraction of a depth in cells
#define ATTRIBUTE_WEIGHT_BITS 24  // fraction of a corner's weight
#define ATTRIBUTE_UV_BITS 20      // fraction of a texture coordinate

// Storage buffers besides those of voxelize.h. Sums have 64 bits in two buffers, so that the upper
// words cause no traffic unless a sum carries.
#define ATTRIBUTES_CARRIES 7  // word 0: not 0 if any sum carried; then the upper words of the sums
