#include "server/voxel/solid/flood.h"

#include <algorithm>

#include "server/base/cancel_point.h"
#include "server/voxel/solid/regions.h"

namespace voxeld {
namespace {

// The cells of a tile that the flood did not reach.
SparseTile unreached(const Regions& regions, size_t number) {
  SparseTile tile;
  const glm::ivec3 coord = regions.tile_at(number);
  tile.coord = {coord.x, coord.y, coord.z};
  if (!regions.is_divided(number)) {
    if (regions.reached(number, 0)[0] == 0) tile.full.push_back({0, kTileLevels});
    return tile;
  }
  for (uint32_t morton = 0; morton < kTileBrickCount; ++morton) {
    BrickPlanes planes = regions.reached(number, morton);
    for (uint64_t& word : planes) word = ~word;
    if (std::ranges::all_of(planes, [](uint64_t word) { return word == 0; })) continue;
    tile.brick_morton.push_back(morton);
    tile.masks.push_back(brick_of_planes(planes));
  }
  canonicalize(tile);
  return tile;
}

}  // namespace

Status flood_inside(std::span<const SparseTile> touched, const glm::ivec3& dims,
                    const ColumnProgress& progress, std::vector<SparseTile>& tiles) {
  Regions regions(touched, dims);
  VOXELD_TRY(regions.flood_outside(progress));
  for (size_t number = 0; number < regions.tile_count(); ++number) {
    cancel_point();
    SparseTile tile = unreached(regions, number);
    if (!tile.empty()) tiles.push_back(std::move(tile));
  }
  return {};
}

}  // namespace voxeld
