#include "server/grid/tile_source.h"

#include <algorithm>
#include <glm/common.hpp>
#include <limits>
#include <numeric>
#include <optional>
#include <thread>
#include <utility>

#include "proto/limits.h"
#include "server/base/cancel_point.h"
#include "server/base/parallel.h"

namespace voxeld {
namespace {

// Two per core, so a slow tile does not leave the other cores idle.
size_t parallel_batch() {
  return size_t{2} * std::max(1u, std::thread::hardware_concurrency());
}

Grid without_tiles(const Grid& grid) {
  Grid copy;
  copy.spec = grid.spec;
  copy.channels = grid.channels;
  copy.meta = grid.meta;
  return copy;
}

CellBox box_of(const SparseTile& tile) {
  CellBox box{glm::ivec3(std::numeric_limits<int>::max()),
              glm::ivec3(std::numeric_limits<int>::min())};
  for_each_voxel(tile, [&](int x, int y, int z, size_t) {
    cancel_point();
    box.min = glm::min(box.min, glm::ivec3(x, y, z));
    box.max = glm::max(box.max, glm::ivec3(x, y, z) + 1);
  });
  return box;
}

// The first occupied cell along an axis, or the end of the last one if `high`. Searches the
// outermost layer of tiles that has voxels. A tile whose voxels reach the layer's outer face ends
// the search. 0 if there are no voxels.
Result<int> find_side(const TileSource& source, size_t axis, bool high) {
  const auto& coords = source.coords();
  std::vector<size_t> order(coords.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::ranges::stable_sort(order, [&](size_t a, size_t b) {
    return high ? coords[a][axis] > coords[b][axis] : coords[a][axis] < coords[b][axis];
  });
  const auto c = static_cast<int>(axis);
  std::optional<int> side;
  int32_t layer = 0;
  for (const size_t index : order) {
    const int32_t here = coords[index][axis];
    if (side && here != layer) break;
    VOXELD_ASSIGN(const SparseTile tile, source.tile(index));
    if (tile.empty()) continue;
    layer = here;
    const CellBox box = box_of(tile);
    const int found = high ? box.max[c] : box.min[c];
    if (!side || (high ? found > *side : found < *side)) side = found;
    const int face = (here + (high ? 1 : 0)) * limits::kTileSide;
    if (*side == std::min(face, source.grid().spec.dims[c])) break;
  }
  return side.value_or(0);
}

}  // namespace

uint32_t coord_order(const TileCoord& coord) {
  return morton_encode(static_cast<uint32_t>(coord[0]), static_cast<uint32_t>(coord[1]),
                       static_cast<uint32_t>(coord[2]));
}

size_t tile_bytes(const SparseTile& tile) {
  size_t attributes = 0;
  for (const ChannelInfo& info : kChannels) attributes += channel_bytes(tile, info.channel).size();
  return tile.masks.size() * (sizeof(BrickMask) + sizeof(uint32_t)) +
         tile.full.size() * sizeof(FullNode) + attributes;
}

Result<std::vector<SparseTile>> read_tiles(const TileSource& source, size_t begin, size_t end) {
  std::vector<SparseTile> tiles(end - begin);
  std::vector<Status> done(end - begin);
  const auto read = [&](size_t i) {
    cancel_point();
    auto tile = source.tile(begin + i);
    if (tile) {
      tiles[i] = *std::move(tile);
    } else {
      done[i] = tile.error();
    }
  };
  if (end - begin == 1) {
    read(0);
  } else {
    parallel_for(end - begin, read);
  }
  for (const Status& status : done) VOXELD_TRY(status);
  return tiles;
}

Status for_each_batch(const TileSource& source,
                      const std::function<Status(std::vector<SparseTile>)>& take) {
  const size_t count = source.coords().size(), step = source.batch();
  for (size_t at = 0; at < count; at += step) {
    VOXELD_ASSIGN(std::vector<SparseTile> tiles,
                  read_tiles(source, at, std::min(count, at + step)));
    std::erase_if(tiles, [](const SparseTile& tile) { return tile.empty(); });
    if (!tiles.empty()) VOXELD_TRY(take(std::move(tiles)));
  }
  return {};
}

ContainerTiles::ContainerTiles(GridReader reader, std::function<Status()> before_tile)
    : reader_(std::move(reader)), before_tile_(std::move(before_tile)) {
  grid_ = grid_of_header(reader_.header());
  coords_.reserve(reader_.tile_count());
  for (size_t i = 0; i < reader_.tile_count(); ++i) coords_.push_back(reader_.tile_coord(i));
}

Result<SparseTile> ContainerTiles::tile(size_t index) const {
  if (before_tile_) VOXELD_TRY(before_tile_());
  return reader_.decode_tile(index);
}

size_t ContainerTiles::batch() const {
  return parallel_batch();
}

GridTiles::GridTiles(const Grid& grid) : whole_(grid) {
  grid_ = without_tiles(grid);
  for (const SparseTile& tile : grid.tiles) coords_.push_back(tile.coord);
}

size_t GridTiles::batch() const {
  return parallel_batch();
}

SomeTiles::SomeTiles(const TileSource& source, const std::function<bool(const TileCoord&)>& wanted)
    : source_(source) {
  grid_ = without_tiles(source.grid());
  for (size_t i = 0; i < source.coords().size(); ++i) {
    if (!wanted(source.coords()[i])) continue;
    indexes_.push_back(i);
    coords_.push_back(source.coords()[i]);
  }
}

CachedTiles::CachedTiles(const TileSource& source, size_t bytes_max)
    : source_(source), bytes_max_(bytes_max) {
  grid_ = without_tiles(source.grid());
  coords_ = source.coords();
}

Result<SparseTile> CachedTiles::tile(size_t index) const {
  {
    const std::lock_guard lock(mutex_);
    if (const auto place = places_.find(index); place != places_.end()) {
      kept_.splice(kept_.begin(), kept_, place->second);
      return kept_.front().tile;
    }
  }
  VOXELD_ASSIGN(SparseTile tile, source_.tile(index));
  cancel_point();
  const std::lock_guard lock(mutex_);
  if (places_.contains(index)) return tile;
  kept_.push_front({index, tile});
  places_[index] = kept_.begin();
  bytes_ += tile_bytes(tile);
  while (bytes_ > bytes_max_) {
    bytes_ -= tile_bytes(kept_.back().tile);
    places_.erase(kept_.back().index);
    kept_.pop_back();
  }
  return tile;
}

Result<std::vector<SparseTile>> CachedTiles::tiles_in(const CellBox& cells) const {
  const glm::ivec3 first = cells.min / limits::kTileSide;
  const glm::ivec3 last = (cells.max - 1) / limits::kTileSide;
  const auto order = [](const TileCoord& c) { return coord_order(c); };
  std::vector<SparseTile> tiles;
  for (int z = first.z; z <= last.z; ++z) {
    for (int y = first.y; y <= last.y; ++y) {
      for (int x = first.x; x <= last.x; ++x) {
        cancel_point();
        const TileCoord wanted = {x, y, z};
        const auto at = std::ranges::lower_bound(coords_, coord_order(wanted), {}, order);
        if (at == coords_.end() || *at != wanted) continue;
        VOXELD_ASSIGN(SparseTile found, tile(static_cast<size_t>(at - coords_.begin())));
        if (!found.empty()) tiles.push_back(std::move(found));
      }
    }
  }
  return tiles;
}

Result<CellBox> occupied_box(const TileSource& source) {
  CellBox box;
  for (size_t axis = 0; axis < 3; ++axis) {
    const auto c = static_cast<int>(axis);
    VOXELD_ASSIGN(box.min[c], find_side(source, axis, false));
    VOXELD_ASSIGN(box.max[c], find_side(source, axis, true));
  }
  return box;
}

}  // namespace voxeld
