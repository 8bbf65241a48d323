// A grid as the ray march reads it: tables that are uploaded as they are.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "server/grid/grid.h"

namespace voxeld {

struct PackedGrid {
  GridSpec spec;
  glm::ivec3 tile_dims{0};  // tiles of 256^3 voxels to each side
  // Contents: shaders/shared/raymarch.h.
  std::vector<uint32_t> nodes;
  std::vector<uint32_t> bricks;
  bool has_color = false, has_normal = false;
  std::vector<uint32_t> colors;   // empty without colours
  std::vector<uint32_t> normals;  // empty without normals
  // Cells [occupied_min, occupied_max) hold all voxels; the whole grid when there are none.
  glm::ivec3 occupied_min{0}, occupied_max{0};
  // Mean colour of the voxels that have one, for those in full nodes, which have none; only where
  // there are both.
  std::optional<std::array<uint8_t, 3>> full_color;
  uint64_t attribute_count = 0;  // voxels that have colours and normals, where the grid has them
};

// A grid with labels or materials and no colours is drawn in a colour for each id: id_color().
// Memory grows with the occupied bricks, not with the grid's volume. Errors: grid-too-large when
// 2^32 voxels or more have attributes, or tables of 2^30 entries or more were needed.
Result<PackedGrid> pack_grid(const Grid& grid);

}  // namespace voxeld
