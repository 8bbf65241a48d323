// The arithmetic of pairs of a triangle and a cell that it touches, for a vector of cells at a
// time: the functions of shaders/lib/attribute_area.glsl and attributes.glsl, with the same names,
// for each instruction set. Plain types, for the reason in touch_kernel.h.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/base/simd/cpu_isa.h"

namespace voxeld {

inline constexpr int kPairsMax = 64;   // of a batch; a multiple of the lanes of every set
inline constexpr int kPairStrips = 4;  // AREA_STRIPS

// RowLine of attribute_area.glsl.
struct PairLine {
  int32_t b, span, shift;
  uint32_t reciprocal;
};

// AttributeSide of attributes.glsl.
struct PairSide {
  int32_t a, b;
  int64_t rest;
  int32_t shift;
  bool is_right;
  PairLine line;
};

// A linear form of the position whose clamped value is a corner's weight.
struct PairForm {
  int32_t x, y;
  int64_t rest;
};

// AttributeTriangle of attributes.glsl as far as pairs need it, and the corners' values.
struct PairTriangle {
  PairSide sides[3];
  int32_t slope_i, slope_j;
  int64_t depth;
  PairLine level;
  uint32_t factor;  // 0: no area
  int32_t box_min[2], box_max[2];
  int32_t low, high;
  PairForm form1, form2;
  int64_t limit, reciprocal;
  uint32_t weight;        // of all pairs, or 0: each has that of its area
  bool is_flat;           // the corners have equal values
  int value_count;        // channels beside the weight
  uint32_t values[7][3];  // of each channel, 16 bits; of the corners
};

// TouchTriangle of touch.glsl: the cells of a box that the triangle touches. Numbers of the plane
// are integers below 2^52.
struct PairTouch {
  int32_t cell_min[3], cell_max[3];  // swizzled
  int32_t xy[3][3], yz[3][3], zx[3][3];
  double normal[3], plane, above, below;
  int32_t base_z;
  int axis;  // the dominant one
};

// The tile's occupied cells, see compact_mask().
struct PairVoxels {
  const uint32_t* mask;
  const uint32_t* word_offsets;
  size_t voxel_first;  // of the sums
};

// Touched and occupied cells, swizzled.
struct PairBatch {
  int count = 0;
  alignas(64) int32_t i[kPairsMax];
  alignas(64) int32_t j[kPairsMax];
  alignas(64) int32_t k[kPairsMax];
  uint32_t voxel[kPairsMax];  // in the sums
};

// The areas of pairs and the weights of corners 1 and 2 at their centroids.
struct PairAreas {
  alignas(64) int32_t low[kPairsMax];
  alignas(64) int32_t spacing[kPairsMax];
  alignas(64) uint32_t length[kPairsMax];
  alignas(64) uint32_t area[kPairsMax];
  alignas(64) uint32_t weight[kPairsMax];
  alignas(64) int32_t w1[kPairsMax];
  alignas(64) int32_t w2[kPairsMax];
  struct Strip {
    alignas(64) uint32_t length[kPairsMax], x[kPairsMax], y[kPairsMax], squares[kPairsMax];
  } strips[kPairStrips];
};

struct AttributeKernel {
  // Adds the weight and the weighted values of each pair to its voxel's sums, 1 + value_count of
  // them. pairs: memory.
  void (*add)(const PairTriangle& triangle, const PairTouch& touch, const PairVoxels& voxels,
              PairBatch& pairs, uint64_t* sums);
  // Measures the pairs, a batch at a time, and calls `take` with each batch.
  void (*measure)(const PairTriangle& triangle, const PairTouch& touch, const PairVoxels& voxels,
                  PairBatch& pairs, PairAreas& areas, void (*take)(void* context), void* context);
};

extern const AttributeKernel kAttributeKernelPortable;
#if defined(__x86_64__)
extern const AttributeKernel kAttributeKernelSse4;
extern const AttributeKernel kAttributeKernelAvx2;
extern const AttributeKernel kAttributeKernelAvx512;
#endif

// The kernel of a set; CHECKs that the set is supported.
const AttributeKernel& attribute_kernel(CpuIsa isa);

}  // namespace voxeld
