// A grid as the ray march reads it: tables that are uploaded as they are.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "server/grid/grid.h"

namespace voxeld {

struct PackedGrid {
  GridSpec spec;
  glm::ivec3 brick_dims{0};  // bricks of 8^3 voxels to each side
  glm::ivec3 block_dims{0};  // blocks of 32^3 voxels to each side
  // Contents: shaders/shared/raymarch.h says which is which.
  std::vector<uint32_t> block_bits;
  std::vector<uint32_t> brick_index;
  std::vector<uint32_t> brick_masks;
  std::vector<uint32_t> brick_offsets;
  bool has_color = false, has_normal = false;
  std::vector<uint32_t> colors;   // empty without colours
  std::vector<uint32_t> normals;  // empty without normals
  // Cells [occupied_min, occupied_max) hold all voxels; the whole grid when there are none.
  glm::ivec3 occupied_min{0}, occupied_max{0};
  uint64_t voxel_count = 0;  // of the bricks in the tables, the shared one included
};

// All bricks of full nodes are one brick of the tables, so they cost an index each and no mask, and
// section planes may cut into them. Their voxels have the mean colour of the others.

// Errors: grid-too-large when the tables would have 2^32 voxels or more.
Result<PackedGrid> pack_grid(const Grid& grid);

}  // namespace voxeld
