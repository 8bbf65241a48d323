// Parameters, bindings and layouts of the pass that moves a frame's vertices to its pose and snaps
// them (skin.comp), read by C++ and GLSL.
#ifdef __cplusplus
#pragma once
#endif
#include "shaders/shared/types.h"

// Storage buffers. Buffers without "out" are uploaded once for the sequence.
#define SKIN_VERTICES 0      // out: 3 ints per vertex, q in grid space: BATCH_VERTICES
#define SKIN_POSITIONS 1     // out: 3 doubles per vertex, world units of the file
#define SKIN_POINTS 2        // 3 doubles per vertex, or per influence (SKIN_POINT_PER_INFLUENCE)
#define SKIN_FIRSTS 3        // uint per vertex and one more: first influence; then first morph
#define SKIN_INFLUENCES 4    // SkinInfluence
#define SKIN_MORPH_DELTAS 5  // SkinMorph
#define SKIN_FRAME 6         // doubles of the frame, laid out below
#define SKIN_STATE 7         // out: uint, SKIN_OUTSIDE | SKIN_LOST
// Uniform buffer.
#define SKIN_PARAMS 0

#define SKIN_GROUP_SIZE 64
// The most influences and morphs of one vertex. Software drivers stop an invocation after 65,535
// loop iterations.
#define SKIN_LOOP_MAX 32768

// Layout of SKIN_FRAME, in doubles. Matrices are columns of three rows; morph weights follow them.
#define SKIN_WORLD_FROM_FILE 0  // 12
#define SKIN_ORIGIN 12          // 3: GridSpec::origin_world
#define SKIN_VOXEL 15           // 3: GridSpec::voxel_size
#define SKIN_PER_VOXEL 18       // 3: 1 / voxel_size
#define SKIN_LIMIT 21           // 1: the largest finite coordinate
#define SKIN_MATRICES 22        // 12 each: Pose::world_from_bound

// Bits of SKIN_STATE.
#define SKIN_OUTSIDE 1u  // a vertex is in no cell of the grid
#define SKIN_LOST 2u     // a vertex is not finite

VOXELD_SHARED_BEGIN

struct SkinParams {
  ivec4 dims;  // xyz: cells of the grid; w unused
  uint vertex_count;
  uint is_turned;         // 1 if world_from_file is not the identity
  uint writes_positions;  // 1 if SKIN_POSITIONS is wanted
  uint morph_weights;     // first in SKIN_FRAME
};

struct SkinInfluence {
  uint matrix_index;  // among those of the pose
  uint unused;
  double weight;
};

struct SkinMorph {
  uint weight_index;  // among the morph weights
  uint unused;
  double x, y, z;
};

VOXELD_SHARED_END

#ifdef __cplusplus
static_assert(sizeof(voxeld::shared::SkinParams) == 32);
static_assert(sizeof(voxeld::shared::SkinInfluence) == 16);
static_assert(sizeof(voxeld::shared::SkinMorph) == 32);
#endif
