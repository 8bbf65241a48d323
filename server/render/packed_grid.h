// A grid as the ray march reads it, in tables that are uploaded unchanged.
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
  glm::ivec3 tile_dims{0};  // number of tiles of 256^3 voxels along each side
  // Layout: shaders/shared/raymarch.h.
  std::vector<uint32_t> nodes;
  std::vector<uint32_t> bricks;
  bool has_color = false, has_normal = false;
  std::vector<uint32_t> colors;   // empty without colours
  std::vector<uint32_t> normals;  // empty without normals
  // Cells [occupied_min, occupied_max) contain all voxels; the whole grid if there are none.
  glm::ivec3 occupied_min{0}, occupied_max{0};
  // Colour for voxels inside of solids, which have none: the mean of the voxels that have one. Set
  // only if the grid has both kinds.
  std::optional<std::array<uint8_t, 3>> full_color;
  // The median luminance of the voxels' colours in linear light; 1 without colours.
  double luminance = 1.0;
  std::vector<glm::ivec3> hull;  // hull_points(); of the whole grid if there are no voxels
  uint64_t attribute_count = 0;  // number of voxels with colours and normals, if the grid has those
};

// Packs a grid. A grid with labels or materials but no colours gets a colour for each id:
// id_color(). Memory grows with the occupied bricks, not with the grid's volume. Errors:
// grid-too-large if 2^32 voxels or more have attributes, the table of bricks would exceed
// kDrawnTableBytesMax, or that of nodes would need 2^30 entries or more. Has cancellation points.
Result<PackedGrid> pack_grid(const Grid& grid);

}  // namespace voxeld
