// The sparse grid in CPU memory: its place and its occupied tiles.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "proto/grid_format.h"
#include "proto/sparse_tile.h"
#include "server/grid/grid_spec.h"

namespace voxeld {

struct Grid {
  GridSpec spec;
  ChannelSet channels;
  std::vector<SparseTile> tiles;  // occupied ones only, ascending Morton order of coord
  std::string meta_json = "{}";   // see JobResult::meta_json; carried by every format

  uint64_t voxel_count() const;
};

// Mean colour of the voxels that have one, of linear light, as sRGB R, G, B; for pictures and
// palettes, which need a colour for the voxels of full nodes. kNeutralColor where no voxel has any.
std::array<uint8_t, 3> mean_color(const Grid& grid);
inline constexpr std::array<uint8_t, 3> kNeutralColor = {0xb4, 0xb4, 0xb4};

// An sRGB colour for an id, for pictures and palettes of grids whose voxels have ids but no colour:
// ids that follow each other differ much. 0, no id, is kNeutralColor.
std::array<uint8_t, 3> id_color(uint16_t id);
// The channel whose ids colour the voxels of a grid without colour: label, else material; none
// where the grid has colour or neither.
std::optional<Channel> coloring_ids(const Grid& grid);
// A voxel's number in a tile -> its id in that channel.
uint16_t voxel_id(const SparseTile& tile, Channel channel, size_t voxel);

// Tiles of a grid ascend by this: the Morton order of their coords.
uint32_t tile_order(const SparseTile& tile);

// Brings tiles into storage order and drops empty ones.
void normalize_tiles(Grid& grid);

// Reads a whole native container. Errors as GridReader.
Result<Grid> grid_from_container(std::span<const uint8_t> bytes);
GridHeader container_header(const Grid& grid);

}  // namespace voxeld
