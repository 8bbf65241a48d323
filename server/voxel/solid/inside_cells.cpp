#include "server/voxel/solid/inside_cells.h"

#include <algorithm>
#include <bit>
#include <iterator>

#include "server/base/cancel_point.h"

namespace voxeld {

uint64_t count_of(const BrickMask& mask) {
  uint64_t count = 0;
  for (const uint64_t word : mask.words) count += static_cast<uint64_t>(std::popcount(word));
  return count;
}

BrickMask brick_of(const SparseTile& tile, uint32_t morton) {
  const auto after = std::ranges::upper_bound(tile.full, morton, {}, &FullNode::brick_morton);
  if (after != tile.full.begin()) {
    const FullNode& node = *std::prev(after);
    if (morton - node.brick_morton < node.brick_count()) {
      BrickMask all;
      all.words.fill(~uint64_t{0});
      return all;
    }
  }
  const auto found = std::ranges::lower_bound(tile.brick_morton, morton);
  if (found == tile.brick_morton.end() || *found != morton) return {};
  return tile.masks[static_cast<size_t>(found - tile.brick_morton.begin())];
}

InsideCells::InsideCells(std::vector<SparseTile>& tiles, const Regions& regions)
    : tiles_(tiles),
      regions_(regions),
      places_(regions.tile_count(), kNone),
      changes_(regions.tile_count()) {
  for (size_t i = 0; i < tiles.size(); ++i) {
    const auto& coord = tiles[i].coord;
    places_[regions.tile_number({coord[0], coord[1], coord[2]})] = static_cast<uint32_t>(i);
  }
}

BrickMask InsideCells::brick(size_t number, uint32_t morton) const {
  return places_[number] == kNone ? BrickMask{} : brick_of(tiles_[places_[number]], morton);
}

uint64_t InsideCells::count(size_t number) const {
  return places_[number] == kNone ? 0 : tiles_[places_[number]].voxel_count();
}

void InsideCells::change(size_t number, uint32_t morton, const BrickMask& cells, bool inside) {
  changes_[number].push_back({morton, inside, cells});
}

void InsideCells::change_tile(size_t number, bool inside) {
  SparseTile& tile = tile_of(number);
  tile.brick_morton.clear();
  tile.masks.clear();
  tile.full.clear();
  if (inside) tile.full.push_back({0, kTileLevels});
}

SparseTile& InsideCells::tile_of(size_t number) {
  if (places_[number] == kNone) {
    places_[number] = static_cast<uint32_t>(tiles_.size());
    const glm::ivec3 coord = regions_.tile_at(number);
    tiles_.emplace_back().coord = {coord.x, coord.y, coord.z};
  }
  return tiles_[places_[number]];
}

void InsideCells::apply(const std::vector<Change>& changes, std::vector<BrickMask>& bricks,
                        SparseTile& tile) {
  bricks.assign(kTileBrickCount, {});
  for_each_brick(tile,
                 [&](uint32_t morton, const BrickMask& mask, size_t) { bricks[morton] = mask; });
  for (const Change& change : changes) {
    cancel_point();
    for (size_t w = 0; w < 8; ++w) {
      uint64_t& word = bricks[change.morton].words[w];
      word = change.inside ? word | change.cells.words[w] : word & ~change.cells.words[w];
    }
  }
  tile.brick_morton.clear();
  tile.masks.clear();
  tile.full.clear();
  for (uint32_t morton = 0; morton < kTileBrickCount; ++morton) {
    if (bricks[morton] == BrickMask{}) continue;
    tile.brick_morton.push_back(morton);
    tile.masks.push_back(bricks[morton]);
  }
  canonicalize(tile);
}

void InsideCells::finish() {
  std::vector<BrickMask> bricks;
  for (size_t number = 0; number < changes_.size(); ++number) {
    cancel_point();
    if (!changes_[number].empty()) apply(changes_[number], bricks, tile_of(number));
  }
  std::erase_if(tiles_, [](const SparseTile& tile) { return tile.empty(); });
}

}  // namespace voxeld
