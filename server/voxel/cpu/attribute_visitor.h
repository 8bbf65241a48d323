// What one triangle adds to the sums of the cells that it touches: the C++ side of
// shaders/lib/attribute_visit.glsl.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include <glm/vec3.hpp>

#include "server/voxel/attribute_records.h"
#include "server/voxel/mip_chain.h"

namespace voxeld {

// What color=nearest knows of a voxel so far.
struct NearestColor {
  double squared = 1e300;              // distance of the surface to the centre, 1/512 voxel
  std::array<uint16_t, 4> linear16{};  // its colour there
};

// A box of cells whose voxels are neighbours in storage, with their sums.
struct AttributeTarget {
  std::span<const uint32_t> mask, word_offsets;  // of the tile, see compact_mask()
  glm::ivec3 cell_first{0}, cell_last{0};        // of the box, inclusive, in the tile
  size_t voxel_first = 0;                        // of the box
  uint64_t* sums = nullptr;                      // channels.count() per voxel of the box
  AttributeChannels channels;
  NearestColor* nearest = nullptr;  // one per voxel of the box, instead of sums
};

// A triangle as the records describe it. `levels`: of its image, empty without one.
struct AttributeSource {
  std::array<glm::ivec3, 3> corners;  // q in the tile, in ascending order
  int axis = 2;                       // dominant
  const uint32_t* words = nullptr;    // ATTRIBUTE_WORDS, shaders/shared/attributes.h
  std::span<const MipLevel> levels;
};

void add_attributes(const AttributeSource& source, const AttributeTarget& target);

// A triangle that lies within one cell and has one colour; no normals are summed.
struct OneCellSource {
  glm::ivec3 cell{0};   // in the tile
  uint32_t weight = 0;  // one_cell_weight()
  std::array<uint16_t, 4> linear16{};
};
void add_one_cell(const OneCellSource& source, const AttributeTarget& target);

}  // namespace voxeld
