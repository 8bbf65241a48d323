// The sparse grid in CPU memory: its placement and its occupied tiles.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "proto/container/grid_format.h"
#include "server/grid/grid_meta.h"
#include "server/grid/grid_spec.h"

namespace voxeld {

struct Grid {
  GridSpec spec;
  ChannelSet channels;
  std::vector<SparseTile> tiles;  // occupied ones only, ascending Morton order of coord
  GridMeta meta;

  uint64_t voxel_count() const;
};

// The mean colour, in linear light, of the voxels that have one, as sRGB R, G, B. Images and
// palettes use it for the voxels of full nodes. kNeutralColor if no voxel has a colour.
std::array<uint8_t, 3> mean_color(const Grid& grid);
inline constexpr std::array<uint8_t, 3> kNeutralColor = {0xb4, 0xb4, 0xb4};
// Whether a voxel with attributes, of a grid with colours, has a colour of its own: those inside of
// solids, in bricks that are not full, have (0,0,0,0).
inline bool has_own_color(const SparseTile& tile, size_t voxel) {
  const uint8_t* const color = &tile.color[4 * voxel];
  return (color[0] | color[1] | color[2] | color[3]) != 0;
}

// An sRGB colour for an id, for images and palettes of grids with ids but no colour. Consecutive
// ids differ much. Id 0 (none) gives kNeutralColor.
std::array<uint8_t, 3> id_color(uint16_t id);
// The channel whose ids colour a grid without colour: the last one of ids that the grid has, so
// labels before materials. nullopt if the grid has colour, or no ids.
std::optional<Channel> coloring_ids(const Grid& grid);

// The value of kDistanceSteps steps of channel distance: 1 voxel, or with distance=world the
// shortest edge of a voxel in world units.
double distance_unit(const Grid& grid);

// The sort key of a grid's tiles: the Morton code of the coord.
uint32_t tile_order(const SparseTile& tile);

// Sorts tiles into storage order and drops empty ones.
void normalize_tiles(Grid& grid);

// Reads a whole native container. Errors as GridReader.
Result<Grid> grid_from_container(std::span<const uint8_t> bytes);
GridHeader container_header(const Grid& grid);

}  // namespace voxeld
