// Addition of one triangle to the sums of the cells that it touches: the C++ counterpart of
// shaders/lib/attribute_visit.glsl.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include <glm/vec3.hpp>

#include "server/voxel/attributes/attribute_records.h"
#include "server/voxel/attributes/mip_chain.h"
#include "server/voxel/cpu/kernels/attributes/attribute_kernel.h"

namespace voxeld {

// The nearest surface found for a voxel so far, for color=nearest.
struct NearestColor {
  double squared = 1e300;  // squared distance of the surface to the centre, in 1/512 voxel
  std::array<uint16_t, 4> linear16{};  // the surface's colour there
};

// A box of cells whose voxels are contiguous in storage, and their sums.
struct AttributeTarget {
  std::span<const uint32_t> mask, word_offsets;  // the tile's; see compact_mask()
  glm::ivec3 cell_first{0}, cell_last{0};        // the box, inclusive, in the tile's cells
  size_t voxel_first = 0;                        // first voxel of the box
  uint64_t* sums = nullptr;                      // channels.count() per voxel of the box
  AttributeChannels channels;
  NearestColor* nearest = nullptr;  // one per voxel of the box, instead of sums
};

// A triangle as the records describe it. levels: its image's; empty without an image.
struct AttributeSource {
  std::array<glm::ivec3, 3> corners;  // q in the tile, in ascending order
  int axis = 2;                       // dominant
  const uint32_t* words = nullptr;    // ATTRIBUTE_WORDS, shaders/shared/attributes.h
  std::span<const MipLevel> levels;
};

// Memory of a visit, which later ones use again.
struct PairMemory {
  PairTriangle triangle{};
  PairTouch touch{};
  PairBatch pairs{};
  PairAreas areas{};
};

// Adds triangles, one after the other. Not thread safe.
class AttributeVisitor {
 public:
  explicit AttributeVisitor(CpuIsa isa) : kernel_(&attribute_kernel(isa)) {}

  void add(const AttributeSource& source, const AttributeTarget& target);

 private:
  const AttributeKernel* kernel_;
  PairMemory memory_;
};

// A triangle within one cell and with a single colour. No normals are summed for it.
struct OneCellSource {
  glm::ivec3 cell{0};   // in the tile
  uint32_t weight = 0;  // one_cell_weight()
  std::array<uint16_t, 4> linear16{};
};
void add_one_cell(const OneCellSource& source, const AttributeTarget& target);

}  // namespace voxeld
