#include "server/grid/grid.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "proto/canonical_tile.h"
#include "server/base/sha256.h"

namespace voxeld {
namespace {

uint32_t tile_order(const SparseTile& tile) {
  return morton_encode(static_cast<uint32_t>(tile.coord[0]), static_cast<uint32_t>(tile.coord[1]),
                       static_cast<uint32_t>(tile.coord[2]));
}

template <typename T>
std::span<const uint8_t> bytes_of(const T* data, size_t count) {
  static_assert(std::endian::native == std::endian::little, "hashes are of little-endian bytes");
  return {reinterpret_cast<const uint8_t*>(data), count * sizeof(T)};
}

}  // namespace

uint64_t Grid::voxel_count() const {
  uint64_t count = 0;
  for (const SparseTile& tile : tiles) count += tile.voxel_count();
  return count;
}

void normalize_tiles(Grid& grid) {
  std::erase_if(grid.tiles, [](const SparseTile& tile) { return tile.empty(); });
  std::ranges::sort(grid.tiles, {}, tile_order);
}

Result<Grid> grid_from_container(std::span<const uint8_t> bytes) {
  VOXELD_ASSIGN(const GridReader reader, GridReader::open(bytes));
  const GridHeader& header = reader.header();
  Grid grid;
  for (int c = 0; c < 3; ++c) {
    const auto i = static_cast<size_t>(c);
    grid.spec.dims[c] = header.dims[i];
    grid.spec.origin_world[c] = header.origin[i];
    grid.spec.voxel_size[c] = header.voxel_size[i];
  }
  grid.has_color = header.has_color;
  grid.has_normal = header.has_normal;
  grid.meta_json = header.meta_json;
  grid.tiles.reserve(reader.tile_count());
  for (size_t i = 0; i < reader.tile_count(); ++i) {
    VOXELD_ASSIGN(SparseTile tile, reader.decode_tile(i));
    grid.tiles.push_back(std::move(tile));
  }
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
  header.has_color = grid.has_color;
  header.has_normal = grid.has_normal;
  header.meta_json = grid.meta_json;
  return header;
}

namespace {

// In place of the next tile's coord, which is never negative.
constexpr int32_t kFullNodesFollow = -1;

void hash_tile(const SparseTile& tile, Sha256& hash) {
  hash.update(bytes_of(tile.coord.data(), tile.coord.size()));
  const uint64_t bricks = tile.masks.size();
  hash.update(bytes_of(&bricks, 1));
  hash.update(bytes_of(tile.brick_morton.data(), tile.brick_morton.size()));
  hash.update(bytes_of(tile.masks.data(), tile.masks.size()));
  hash.update(bytes_of(tile.color.data(), tile.color.size()));
  hash.update(bytes_of(tile.normal.data(), tile.normal.size()));
  if (tile.full.empty()) return;
  hash.update(bytes_of(&kFullNodesFollow, 1));
  const uint64_t nodes = tile.full.size();
  hash.update(bytes_of(&nodes, 1));
  for (const FullNode& node : tile.full) {
    const uint32_t words[2] = {node.brick_morton, node.level};
    hash.update(bytes_of(words, 2));
  }
}

}  // namespace

std::string content_hash(const Grid& grid) {
  const GridHeader header = container_header(grid);
  std::vector<const SparseTile*> tiles;
  for (const SparseTile& tile : grid.tiles) {
    if (!tile.empty()) tiles.push_back(&tile);
  }
  std::ranges::sort(tiles, {}, [](const SparseTile* tile) { return tile_order(*tile); });

  Sha256 hash;
  hash.update("voxeld grid 1");
  hash.update(bytes_of(header.dims.data(), header.dims.size()));
  hash.update(bytes_of(header.origin.data(), header.origin.size()));
  hash.update(bytes_of(header.voxel_size.data(), header.voxel_size.size()));
  const uint8_t channels[2] = {header.has_color, header.has_normal};
  hash.update(channels);
  SparseTile copy;
  for (const SparseTile* tile : tiles) hash_tile(canonical_form(*tile, copy), hash);
  return hash.finish_id();
}

}  // namespace voxeld
