#include "server/voxel/solid/interior.h"

#include <algorithm>
#include <atomic>
#include <bit>

#include "server/base/cancel_point.h"
#include "server/voxel/solid/distance/brick_index.h"
#include "server/voxel/solid/distance/nearest_cells.h"
#include "server/voxel/solid/inside_cells.h"

namespace voxeld {
namespace {

// Finds where the voxels of a grid have their attributes.
class VoxelPlaces {
 public:
  VoxelPlaces(std::vector<SparseTile>& tiles, const glm::ivec3& dims)
      : tiles_(tiles), tile_dims_((dims + limits::kTileSide - 1) / limits::kTileSide) {
    numbers_.resize(static_cast<size_t>(tile_dims_.x) * static_cast<size_t>(tile_dims_.y) *
                        static_cast<size_t>(tile_dims_.z),
                    kNone);
    first_.resize(tiles.size());
    for (size_t t = 0; t < tiles.size(); ++t) {
      const SparseTile& tile = tiles[t];
      numbers_[number_of({tile.coord[0], tile.coord[1], tile.coord[2]})] = static_cast<uint32_t>(t);
      uint32_t first = 0;
      cancel_point();
      for (const BrickMask& mask : tile.masks) {
        first_[t].push_back(first);
        first += static_cast<uint32_t>(count_of(mask));
      }
    }
  }

  struct Place {
    uint32_t tile;
    size_t voxel;
  };
  uint32_t first_voxel(size_t tile, size_t brick) const { return first_[tile][brick]; }

  // The place of an occupied cell.
  Place find(const glm::ivec3& cell) const {
    const glm::ivec3 tile = cell / limits::kTileSide;
    const uint32_t number = numbers_[number_of(tile)];
    const glm::uvec3 in_tile(cell - tile * limits::kTileSide);
    const uint32_t morton = morton_encode(in_tile.x / 8, in_tile.y / 8, in_tile.z / 8);
    const std::vector<uint32_t>& bricks = tiles_[number].brick_morton;
    const auto brick =
        static_cast<size_t>(std::ranges::lower_bound(bricks, morton) - bricks.begin());
    const uint32_t bit = morton_encode(in_tile.x & 7, in_tile.y & 7, in_tile.z & 7);
    const BrickMask& mask = tiles_[number].masks[brick];
    size_t voxel = first_[number][brick];
    for (size_t w = 0; w < bit / 64; ++w) {
      voxel += static_cast<size_t>(std::popcount(mask.words[w]));
    }
    const uint64_t below = (uint64_t{1} << (bit % 64)) - 1;
    voxel += static_cast<size_t>(std::popcount(mask.words[bit / 64] & below));
    return {number, voxel};
  }

 private:
  static constexpr uint32_t kNone = UINT32_MAX;
  size_t number_of(const glm::ivec3& tile) const {
    return (static_cast<size_t>(tile.z) * static_cast<size_t>(tile_dims_.y) +
            static_cast<size_t>(tile.y)) *
               static_cast<size_t>(tile_dims_.x) +
           static_cast<size_t>(tile.x);
  }

  const std::vector<SparseTile>& tiles_;
  glm::ivec3 tile_dims_;
  std::vector<uint32_t> numbers_;             // index into tiles_, by the tile's position
  std::vector<std::vector<uint32_t>> first_;  // first voxel of each brick
};

template <typename T>
void copy_samples(const std::vector<T>& from, size_t from_voxel, std::vector<T>& to,
                  size_t to_voxel, size_t width) {
  if (to.empty()) return;
  for (size_t i = 0; i < width; ++i) to[to_voxel * width + i] = from[from_voxel * width + i];
}

struct BrickPlace {
  uint32_t tile, brick;
};

// The bricks of all tiles, grouped by their position along x.
std::vector<std::vector<BrickPlace>> bricks_by_slab(const std::vector<SparseTile>& tiles,
                                                    const glm::ivec3& dims) {
  std::vector<std::vector<BrickPlace>> slabs(
      static_cast<size_t>((dims.x + limits::kBrickSide - 1) / limits::kBrickSide));
  for (size_t t = 0; t < tiles.size(); ++t) {
    cancel_point();
    for (size_t b = 0; b < tiles[t].masks.size(); ++b) {
      const auto x = static_cast<size_t>(tiles[t].coord[0]) * kTileBricks +
                     morton_decode(tiles[t].brick_morton[b])[0];
      slabs[x].push_back({static_cast<uint32_t>(t), static_cast<uint32_t>(b)});
    }
  }
  return slabs;
}

class InteriorFill {
 public:
  InteriorFill(const BrickIndex& surface, const GridSpec& spec, std::vector<SparseTile>& tiles)
      : surface_(surface), places_(tiles, spec.dims), tiles_(tiles) {}

  void fill(const BrickPlace& at, const NearestCells& nearest) {
    SparseTile& tile = tiles_[at.tile];
    const auto brick = morton_decode(tile.brick_morton[at.brick]);
    const glm::ivec3 first =
        glm::ivec3(tile.coord[0], tile.coord[1], tile.coord[2]) * limits::kTileSide +
        glm::ivec3(brick[0], brick[1], brick[2]) * limits::kBrickSide;
    const BrickMask* surface = surface_.find(first / limits::kBrickSide);
    size_t voxel = places_.first_voxel(at.tile, at.brick);
    for (uint32_t w = 0; w < 8; ++w) {
      const uint64_t word = tile.masks[at.brick].words[w];
      for (uint64_t bits = word; bits != 0; bits &= bits - 1, ++voxel) {
        const auto bit = static_cast<uint32_t>(std::countr_zero(bits));
        if (surface != nullptr && (surface->words[w] >> bit & 1) != 0) continue;
        const auto cell = morton_decode(w * 64 + bit);
        copy(nearest.nearest(first + glm::ivec3(cell[0], cell[1], cell[2])), tile, voxel);
      }
    }
  }

 private:
  void copy(const glm::ivec3& from_cell, SparseTile& to, size_t to_voxel) const {
    const VoxelPlaces::Place from = places_.find(from_cell);
    const SparseTile& tile = tiles_[from.tile];
    for_each_channel_member([&](Channel channel, auto member) {
      if (channel_info(channel).is_measure()) return;
      copy_samples(tile.*member, from.voxel, to.*member, to_voxel,
                   channel_info(channel).components);
    });
  }

  const BrickIndex& surface_;
  VoxelPlaces places_;
  std::vector<SparseTile>& tiles_;
};

}  // namespace

void spell_out_full(SparseTile& tile) {
  if (tile.full.empty()) return;
  SparseTile out;
  out.coord = tile.coord;
  for_each_brick(tile, [&](uint32_t morton, const BrickMask& mask, size_t) {
    out.brick_morton.push_back(morton);
    out.masks.push_back(mask);
  });
  tile = std::move(out);
}

int64_t interior_bytes(const GridSpec& spec, std::span<const SparseTile> surface,
                       std::span<const SparseTile> inside, const ChannelSet& channels) {
  // Attributes and bricks count twice, because they exist twice while surface and inside are
  // united.
  const auto voxel_bytes = static_cast<int64_t>(attribute_bytes(channels));
  constexpr int64_t kBrickBytes = 2 * (sizeof(BrickMask) + sizeof(uint32_t)) + 16;
  int64_t bytes = NearestCells::bytes_for(spec.dims);
  for (const auto& list : {surface, inside}) {
    for (const SparseTile& tile : list) {
      auto bricks = static_cast<int64_t>(tile.masks.size());
      for (const FullNode& node : tile.full) bricks += node.brick_count();
      bytes += static_cast<int64_t>(tile.voxel_count()) * voxel_bytes + bricks * kBrickBytes;
    }
  }
  return bytes;
}

Status copy_nearest(std::span<const SparseTile> surface, const GridSpec& spec, ThreadTeam& team,
                    const ColumnProgress& progress, std::vector<SparseTile>& tiles) {
  const BrickIndex index(surface, spec.dims);
  NearestCells nearest(index, spec.dims, team);
  InteriorFill interior(index, spec, tiles);
  const auto slabs = bricks_by_slab(tiles, spec.dims);
  for (size_t slab = 0; slab < slabs.size(); ++slab) {
    if (progress) VOXELD_TRY(progress(0));
    const std::vector<BrickPlace>& bricks = slabs[slab];
    if (bricks.empty()) continue;
    if (!nearest.compute(static_cast<int>(slab))) return {};
    std::atomic<size_t> next = 0;
    team.run(team.threads(), [&](int) {
      for (size_t b = next++; b < bricks.size(); b = next++) {
        cancel_point();
        interior.fill(bricks[b], nearest);
      }
    });
  }
  return {};
}

}  // namespace voxeld
