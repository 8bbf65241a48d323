#include "server/voxel/solid/coverage.h"

#include <algorithm>
#include <bit>
#include <string>
#include <utility>

#include "proto/limits.h"
#include "server/base/cancel_point.h"

namespace voxeld {
namespace {

constexpr uint8_t kAllParts = 64;
// Bricks of a block of 64^3 cells, which is what one finer tile covers.
constexpr uint32_t kPartBrickCount = 512;
constexpr size_t kBrickCells = 512;
static_assert(kCoverageParts * kCoverageParts * kCoverageParts == kAllParts);
static_assert(limits::kTileSide / kCoverageParts == 64);

uint8_t covered(uint8_t parts) {
  return static_cast<uint8_t>((255 * parts + kAllParts / 2) / kAllParts);
}

// Inserts bricks that were parts of full nodes as masks, among those that the tile already has.
void insert_full_masks(const std::vector<uint32_t>& bricks, SparseTile& tile) {
  BrickMask all;
  all.words.fill(~uint64_t{0});
  std::vector<uint32_t> order;
  std::vector<BrickMask> masks;
  size_t own = 0;
  for (const uint32_t brick : bricks) {
    for (; own < tile.masks.size() && tile.brick_morton[own] < brick; ++own) {
      order.push_back(tile.brick_morton[own]);
      masks.push_back(tile.masks[own]);
    }
    order.push_back(brick);
    masks.push_back(all);
  }
  for (; own < tile.masks.size(); ++own) {
    order.push_back(tile.brick_morton[own]);
    masks.push_back(tile.masks[own]);
  }
  tile.brick_morton = std::move(order);
  tile.masks = std::move(masks);
}

// By Morton index; null: no voxels.
std::vector<BrickMask> bricks_of(const SparseTile* tile) {
  std::vector<BrickMask> bricks(size_t{1} << (3 * kTileLevels));
  if (tile == nullptr) return bricks;
  for_each_brick(*tile,
                 [&](uint32_t morton, const BrickMask& mask, size_t) { bricks[morton] = mask; });
  return bricks;
}

}  // namespace

Status check_coverage_dims(const glm::ivec3& dims) {
  constexpr int kSideMax = limits::kGridSideMax / kCoverageParts;
  if (std::max({dims.x, dims.y, dims.z}) <= kSideMax) return {};
  return Error{
      ErrorCode::kGridTooLarge, "coverage of a solid counts the parts of voxels, four to a side",
      "at most " + std::to_string(kSideMax) + " voxels to a side",
      std::to_string(dims.x) + " x " + std::to_string(dims.y) + " x " + std::to_string(dims.z)};
}

int64_t coverage_bytes(const GridSpec& spec, int64_t surface_bytes, int threads) {
  constexpr int64_t kMaskBytes = sizeof(BrickMask) + sizeof(uint32_t);
  const int64_t bricks = surface_bytes / kMaskBytes;
  const glm::ivec3 tiles = spec.tile_dims();
  const int64_t tile_count = int64_t{tiles.x} * tiles.y * tiles.z;
  // Bricks count twice, because their list is copied as it grows. Finer tiles are those of the
  // columns in one step of the threads, with 4x4x4 bricks for each of the surface.
  const int64_t columns = int64_t{tiles.x} * kCoverageParts * tiles.y * kCoverageParts;
  const int64_t step = std::min<int64_t>(columns, int64_t{2} * threads);
  const int64_t in_step = columns == 0 ? 0 : surface_bytes * kAllParts / columns * step;
  constexpr int64_t kTileWork = int64_t{164} << 10;
  return 2 * bricks * static_cast<int64_t>(sizeof(BrickMask) * 8 + 8) +
         tile_count * static_cast<int64_t>(kPartBrickCount * sizeof(uint64_t)) + in_step +
         int64_t{threads} * kCoverageParts * tiles.z * kTileWork;
}

Result<CoverageCounts> CoverageCounts::of(const FillMesh& mesh, const glm::ivec3& dims, Sign sign,
                                          InsideFinder& finder, const ColumnProgress& progress) {
  constexpr int kPartBits = std::countr_zero(unsigned{kCoverageParts});
  const FillMesh finer = mesh.scaled(kPartBits);
  CoverageCounts result;
  std::vector<uint8_t> counts;
  AxisVotes votes;
  const auto go_on = [&](size_t) { return progress ? progress(0) : Status(); };
  const auto take = [&](const std::vector<SparseTile>& tiles) {
    for (const SparseTile& tile : tiles) {
      cancel_point();
      result.add(tile, counts);
    }
  };
  VOXELD_TRY(finder.find({finer, dims * kCoverageParts, sign, {}}, go_on, take, votes));
  result.sort();
  return result;
}

// Adds a finer tile, which is a block of 64^3 cells of a tile. `counts` is scratch memory.
void CoverageCounts::add(const SparseTile& finer, std::vector<uint8_t>& counts) {
  const auto part = [&](size_t axis) {
    return static_cast<uint32_t>(finer.coord[axis] % kCoverageParts);
  };
  TileCounts& tile = tiles_[{finer.coord[0] / kCoverageParts, finer.coord[1] / kCoverageParts,
                             finer.coord[2] / kCoverageParts}];
  const uint32_t first_brick = morton_encode(part(0), part(1), part(2)) * kPartBrickCount;
  counts.assign(size_t{kPartBrickCount} * kBrickCells, 0);
  for (const FullNode& node : finer.full) {
    std::fill_n(counts.begin() + ptrdiff_t{8} * node.brick_morton,
                ptrdiff_t{8} * node.brick_count(), kAllParts);
  }
  for (size_t i = 0; i < finer.masks.size(); ++i) {
    for (size_t w = 0; w < 8; ++w) {
      counts[size_t{8} * finer.brick_morton[i] + w] =
          static_cast<uint8_t>(std::popcount(finer.masks[i].words[w]));
    }
  }
  for (uint32_t brick = 0; brick < kPartBrickCount; ++brick) {
    const auto first = counts.begin() + static_cast<ptrdiff_t>(kBrickCells * brick);
    const auto last = first + static_cast<ptrdiff_t>(kBrickCells);
    const auto [least, most] = std::minmax_element(first, last);
    if (*least == kAllParts) {
      tile.full.set(first_brick + brick);
    } else if (*most > 0) {
      tile.partial.emplace_back().brick_morton = first_brick + brick;
      std::copy(first, last, tile.partial.back().inside.begin());
    }
  }
}

void CoverageCounts::sort() {
  for (auto& [coord, tile] : tiles_) {
    std::ranges::sort(tile.partial, {}, &BrickCounts::brick_morton);
  }
}

CoverageCounts::TileCounts CoverageCounts::settled(const TileCounts* counts,
                                                   const SparseTile* touched,
                                                   const SparseTile* inside) {
  TileCounts out;
  const std::vector<BrickMask> surface = bricks_of(touched), cells = bricks_of(inside);
  for (uint32_t brick = 0; brick < kTileBricks; ++brick) {
    cancel_point();
    const BrickCounts* partial = counts == nullptr ? nullptr : find(*counts, brick);
    const uint8_t uniform = counts != nullptr && counts->full.test(brick) ? kAllParts : uint8_t{0};
    BrickCounts made;
    made.brick_morton = brick;
    for (size_t i = 0; i < kBrickCells; ++i) {
      const auto has = [&](const std::vector<BrickMask>& masks) {
        return (masks[brick].words[i / 64] >> (i % 64) & 1) != 0;
      };
      const uint8_t counted = partial != nullptr ? partial->inside[i] : uniform;
      made.inside[i] = has(surface) ? counted : has(cells) ? kAllParts : uint8_t{0};
    }
    const auto [least, most] = std::ranges::minmax_element(made.inside);
    if (*least == kAllParts) {
      out.full.set(brick);
    } else if (*most > 0) {
      out.partial.push_back(made);
    }
  }
  return out;
}

void CoverageCounts::settle_untouched(std::span<const SparseTile> touched,
                                      std::span<const SparseTile> inside) {
  std::map<std::array<int32_t, 3>, std::array<const SparseTile*, 2>> given;
  for (const SparseTile& tile : touched) given[tile.coord][0] = &tile;
  for (const SparseTile& tile : inside) given[tile.coord][1] = &tile;
  std::erase_if(tiles_, [&](const auto& tile) { return !given.contains(tile.first); });
  for (const auto& [coord, both] : given) {
    const auto counts = tiles_.find(coord);
    tiles_[coord] = settled(counts == tiles_.end() ? nullptr : &counts->second, both[0], both[1]);
  }
}

const CoverageCounts::TileCounts* CoverageCounts::find(const SparseTile& tile) const {
  const auto found = tiles_.find(tile.coord);
  return found == tiles_.end() ? nullptr : &found->second;
}

const CoverageCounts::BrickCounts* CoverageCounts::find(const TileCounts& tile,
                                                        uint32_t brick_morton) {
  const auto found =
      std::ranges::lower_bound(tile.partial, brick_morton, {}, &BrickCounts::brick_morton);
  return found != tile.partial.end() && found->brick_morton == brick_morton ? &*found : nullptr;
}

void CoverageCounts::spell_out(std::vector<SparseTile>& inside) const {
  for (SparseTile& tile : inside) {
    cancel_point();
    spell_out(find(tile), tile);
  }
}

void CoverageCounts::spell_out(const TileCounts* counts, SparseTile& tile) {
  const auto is_covered = [&](const FullNode& node) {
    if (counts == nullptr) return false;
    for (uint32_t i = 0; i < node.brick_count(); ++i) {
      if (!counts->full.test(node.brick_morton + i)) return false;
    }
    return true;
  };
  std::vector<FullNode> kept;
  std::vector<uint32_t> bricks;
  std::vector<FullNode> left(tile.full.rbegin(), tile.full.rend());
  while (!left.empty()) {
    const FullNode node = left.back();
    left.pop_back();
    if (is_covered(node)) {
      kept.push_back(node);
    } else if (node.level == 0) {
      bricks.push_back(node.brick_morton);
    } else {
      const uint32_t child_bricks = node.brick_count() / 8;
      for (uint32_t child = 8; child-- > 0;) {
        left.push_back({node.brick_morton + child * child_bricks, node.level - 1});
      }
    }
  }
  if (bricks.empty()) return;
  tile.full = std::move(kept);
  insert_full_masks(bricks, tile);
}

void CoverageCounts::write(std::vector<SparseTile>& tiles) const {
  for (SparseTile& tile : tiles) write(find(tile), tile);
}

void CoverageCounts::write(const TileCounts* counts, SparseTile& tile) {
  tile.coverage.clear();
  tile.coverage.reserve(tile.attribute_count());
  for (size_t i = 0; i < tile.masks.size(); ++i) {
    cancel_point();
    const uint32_t brick = tile.brick_morton[i];
    const BrickCounts* partial = counts == nullptr ? nullptr : find(*counts, brick);
    const bool is_full = counts != nullptr && counts->full.test(brick);
    for (size_t w = 0; w < 8; ++w) {
      for (uint64_t bits = tile.masks[i].words[w]; bits != 0; bits &= bits - 1) {
        const size_t cell = 64 * w + static_cast<size_t>(std::countr_zero(bits));
        const uint8_t uniform = is_full ? kAllParts : uint8_t{0};
        tile.coverage.push_back(covered(partial != nullptr ? partial->inside[cell] : uniform));
      }
    }
  }
}

}  // namespace voxeld
