#include "server/grid/grid.h"

#include <algorithm>

#include "proto/container/distance_unit.h"
#include "server/base/cancel_point.h"
#include "server/grid/tile_source.h"

namespace voxeld {
uint32_t tile_order(const SparseTile& tile) {
  return morton_encode(static_cast<uint32_t>(tile.coord[0]), static_cast<uint32_t>(tile.coord[1]),
                       static_cast<uint32_t>(tile.coord[2]));
}

uint64_t Grid::voxel_count() const {
  uint64_t count = 0;
  for (const SparseTile& tile : tiles) {
    cancel_point();
    count += tile.voxel_count();
  }
  return count;
}

double distance_unit(const Grid& grid) {
  const glm::dvec3& size = grid.spec.voxel_size;
  return distance_unit(grid.meta.has_world_distances(), {size.x, size.y, size.z});
}

void normalize_tiles(Grid& grid) {
  std::erase_if(grid.tiles, [](const SparseTile& tile) { return tile.empty(); });
  std::ranges::sort(grid.tiles, {}, tile_order);
}

Grid grid_of_header(const GridHeader& header) {
  Grid grid;
  for (int c = 0; c < 3; ++c) {
    const auto i = static_cast<size_t>(c);
    grid.spec.dims[c] = header.dims[i];
    grid.spec.origin_world[c] = header.origin[i];
    grid.spec.voxel_size[c] = header.voxel_size[i];
  }
  grid.channels = header.channels;
  grid.meta = GridMeta::parse(header.meta_json);
  return grid;
}

Result<Grid> grid_from_container(std::span<const uint8_t> bytes) {
  VOXELD_ASSIGN(GridReader reader, GridReader::open(bytes));
  Grid grid = grid_of_header(reader.header());
  const ContainerTiles tiles(std::move(reader));
  VOXELD_ASSIGN(grid.tiles, read_tiles(tiles, 0, tiles.coords().size()));
  return grid;
}

GridHeader container_header(const Grid& grid) {
  GridHeader header;
  for (int c = 0; c < 3; ++c) {
    const auto i = static_cast<size_t>(c);
    header.dims[i] = grid.spec.dims[c];
    header.origin[i] = grid.spec.origin_world[c];
    header.voxel_size[i] = grid.spec.voxel_size[c];
  }
  header.channels = grid.channels;
  header.meta_json = grid.meta.text();
  return header;
}

}  // namespace voxeld
