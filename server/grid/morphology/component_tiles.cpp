#include "server/grid/morphology/component_tiles.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "proto/limits.h"
#include "server/base/cancel_point.h"
#include "server/base/parallel.h"
#include "server/grid/morphology/bit_box.h"
#include "server/grid/morphology/cell_runs.h"

namespace voxeld {
namespace {

// A component of the whole grid, or a part of it in a tile.
struct ComponentPart {
  uint64_t voxels = 0;
  std::array<int, 3> first{};  // z, y, x
};

// A tile that later tiles may touch.
struct OpenTile {
  TileRuns runs;
  uint32_t first_part;  // of its components
  int later;            // neighbours that are still to come
};

// Joins the components of tiles to those of the grid.
class Joiner {
 public:
  Joiner(const TileSource& source, Neighbors neighbors) : neighbors_(neighbors) {
    const auto& coords = source.coords();
    for (size_t i = 0; i < coords.size(); ++i) numbers_[coords[i]] = i;
  }

  // Tiles must come in the order of the source.
  void add(const TileCoord& coord, TileRuns runs, const std::vector<ComponentSize>& sizes) {
    const glm::ivec3 first = first_cell_of(coord);
    OpenTile tile{std::move(runs), static_cast<uint32_t>(parts_.size()), 0};
    firsts_.push_back(tile.first_part);
    for (const ComponentSize& size : sizes) {
      cancel_point();
      constexpr auto kSide = uint32_t{limits::kTileSide};
      const auto at = [&](uint32_t cell) { return static_cast<int>(cell % kSide); };
      parts_.push_back({size.voxels,
                        {first.z + at(size.first_cell / kSide / kSide),
                         first.y + at(size.first_cell / kSide), first.x + at(size.first_cell)}});
    }
    sets_.add_all(sizes.size());
    const size_t own = numbers_.at(coord);
    for_each_neighbor(coord, [&](const std::array<int, 3>& offset, size_t number) {
      if (number > own) {
        ++tile.later;
        return;
      }
      const auto other = open_.find(number);
      for_each_contact(tile.runs, other->second.runs, offset, neighbors_,
                       [&](uint32_t a, uint32_t b) {
                         cancel_point();
                         sets_.unite(tile.first_part + a, other->second.first_part + b);
                       });
      if (--other->second.later == 0) open_.erase(other);
    });
    if (tile.later > 0) open_.emplace(own, std::move(tile));
  }

  // Which components of each tile belong to the largest ones of the grid.
  std::vector<std::vector<bool>> largest(int count) {
    std::vector<uint32_t> roots;
    for (uint32_t i = 0; i < parts_.size(); ++i) {
      cancel_point();
      const uint32_t root = sets_.find(i);
      if (root == i) {
        roots.push_back(i);
        continue;
      }
      parts_[root].voxels += parts_[i].voxels;
      parts_[root].first = std::min(parts_[root].first, parts_[i].first);
    }
    const auto order = [&](uint32_t i) {
      cancel_point();
      return std::tuple(UINT64_MAX - parts_[i].voxels, parts_[i].first);
    };
    std::ranges::sort(roots, {}, order);
    std::vector<bool> is_kept(parts_.size());
    for (size_t i = 0; i < std::min(roots.size(), static_cast<size_t>(count)); ++i) {
      is_kept[roots[i]] = true;
    }
    std::vector<std::vector<bool>> kept(firsts_.size());
    for (size_t t = 0; t < firsts_.size(); ++t) {
      const size_t end = t + 1 < firsts_.size() ? firsts_[t + 1] : parts_.size();
      for (size_t i = firsts_[t]; i < end; ++i) {
        cancel_point();
        kept[t].push_back(is_kept[sets_.find(static_cast<uint32_t>(i))]);
      }
    }
    return kept;
  }

 private:
  // Calls visit(offset, number) for the source's tiles around a tile.
  template <typename Visit>
  void for_each_neighbor(const TileCoord& coord, Visit&& visit) const {
    for (int z = -1; z <= 1; ++z) {
      for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
          if (x == 0 && y == 0 && z == 0) continue;
          const auto found = numbers_.find({coord[0] + x, coord[1] + y, coord[2] + z});
          if (found != numbers_.end()) visit(std::array<int, 3>{x, y, z}, found->second);
        }
      }
    }
  }

  Neighbors neighbors_;
  std::map<TileCoord, size_t> numbers_;
  std::map<size_t, OpenTile> open_;
  std::vector<uint32_t> firsts_;  // part of each tile
  std::vector<ComponentPart> parts_;
  DisjointSets sets_;
};

}  // namespace

ComponentTiles::ComponentTiles(const TileSource& source, Neighbors neighbors)
    : source_(source), neighbors_(neighbors) {
  grid_ = source.grid();
  coords_ = source.coords();
}

Result<std::unique_ptr<ComponentTiles>> ComponentTiles::open(const TileSource& source, int count,
                                                             Neighbors neighbors) {
  Joiner joiner(source, neighbors);
  const size_t all = source.coords().size();
  for (size_t at = 0; at < all; at += source.batch()) {
    VOXELD_ASSIGN(const std::vector<SparseTile> tiles,
                  read_tiles(source, at, std::min(all, at + source.batch())));
    std::vector<std::optional<TileRuns>> runs(tiles.size());
    std::vector<std::vector<ComponentSize>> sizes(tiles.size());
    parallel_for(tiles.size(), [&](size_t i) {
      cancel_point();
      runs[i].emplace(tiles[i]);
      sizes[i] = runs[i]->number_components(neighbors);
      runs[i]->keep_border();
    });
    for (size_t i = 0; i < tiles.size(); ++i) {
      joiner.add(source.coords()[at + i], *std::move(runs[i]), sizes[i]);
    }
  }
  std::unique_ptr<ComponentTiles> made(new ComponentTiles(source, neighbors));
  made->kept_ = joiner.largest(count);
  return made;
}

Result<SparseTile> ComponentTiles::tile(size_t index) const {
  const std::vector<bool>& kept = kept_[index];
  SparseTile none;
  none.coord = coords_[index];
  if (std::ranges::find(kept, true) == kept.end()) return none;
  VOXELD_ASSIGN(SparseTile tile, source_.tile(index));
  if (std::ranges::find(kept, false) == kept.end()) return tile;
  TileRuns runs(tile);
  (void)runs.number_components(neighbors_);
  const glm::ivec3 first = first_cell_of(tile.coord);
  BitBox bits({first, first + limits::kTileSide});
  for (size_t row = 0; row + 1 < runs.row_firsts.size(); ++row) {
    const auto y = static_cast<int>(row % limits::kTileSide);
    const auto z = static_cast<int>(row / limits::kTileSide);
    uint64_t* words = bits.row(first.y + y, first.z + z);
    cancel_point();
    for (uint32_t i = runs.row_firsts[row]; i < runs.row_firsts[row + 1]; ++i) {
      if (!kept[runs.runs[i].component]) continue;
      for (uint32_t x = runs.runs[i].begin; x < runs.runs[i].end; ++x) {
        words[x / 64] |= uint64_t{1} << (x % 64);
      }
    }
  }
  const VoxelLookup values(tile);
  return tile_of_bits(tile.coord, bits, grid_.channels,
                      [&](uint32_t code) { return values.at(code); });
}

}  // namespace voxeld
