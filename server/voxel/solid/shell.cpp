#include "server/voxel/solid/shell.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <memory>

#include "server/base/cancel_point.h"
#include "server/voxel/solid/distance/brick_index.h"
#include "server/voxel/solid/distance/brick_planes.h"
#include "server/voxel/solid/distance/distance.h"

namespace voxeld {
namespace {

constexpr int kBlockSideBricks = 8;  // along a side of a block, the unit of the search: 64 cells
constexpr size_t kShellBlocks =
    kTileBrickCount / (size_t{kBlockSideBricks} * kBlockSideBricks * kBlockSideBricks);
constexpr size_t kBlockBrickCount = kTileBrickCount / kShellBlocks;

enum class Nearness : uint8_t { kNear, kFar, kMixed };

// Finds near cells block by block, each of 8x8x8 bricks. It keeps its memory. Not thread-safe.
class ShellBlock {
 public:
  ShellBlock(const BrickIndex& surface, double thickness)
      : surface_(surface),
        thickness_(thickness),
        limit_(squared_limit(thickness)),
        halo_(static_cast<int>(std::ceil(thickness / limits::kBrickSide))) {}

  // Classifies every brick: all of its cells are near, none is, or some are.
  void classify(const glm::ivec3& first_brick, std::array<Nearness, kBlockBrickCount>& bricks) {
    // Bricks farther apart than this have no cells within the thickness; see `slack`.
    const int halo = halo_ + 2;
    DistanceBox box;
    box.size = glm::ivec3(kBlockSideBricks + 2 * halo);
    box.first = glm::ivec3(halo);
    box.side = kBlockSideBricks;
    squared_distances(
        box,
        [&](int y, int z, std::span<uint8_t> row) {
          for (int x = 0; x < box.size.x; ++x) {
            const glm::ivec3 at = first_brick + glm::ivec3(x, y, z) - halo;
            row[static_cast<size_t>(x)] = surface_.find(at) != nullptr ? 1 : 0;
          }
        },
        scratch_, distances_);
    // Cells of bricks that are D bricks apart are 8 D apart, give or take at most 7 sqrt(3).
    const double slack = (limits::kBrickSide - 1) * std::sqrt(3.0) + 1e-6;
    for (uint32_t i = 0; i < kBlockBrickCount; ++i) {
      const auto at = morton_decode(i);
      const uint32_t squared =
          distances_[(at[2] * kBlockSideBricks + at[1]) * kBlockSideBricks + at[0]];
      const double apart = limits::kBrickSide * std::sqrt(static_cast<double>(squared));
      bricks[i] = squared == kNoDistance || apart - slack > thickness_ ? Nearness::kFar
                  : apart + slack <= thickness_                        ? Nearness::kNear
                                                                       : Nearness::kMixed;
    }
  }

  // Sets the near cells of all bricks of the block.
  void near_cells(const glm::ivec3& first_brick, std::array<BrickMask, kBlockBrickCount>& near) {
    constexpr int kSide = kBlockSideBricks * limits::kBrickSide;
    DistanceBox box;
    box.size = glm::ivec3(kSide + 2 * halo_ * limits::kBrickSide);
    box.first = glm::ivec3(halo_ * limits::kBrickSide);
    box.side = kSide;
    squared_distances(
        box, [&](int y, int z, std::span<uint8_t> row) { fill_row(first_brick, y, z, row); },
        scratch_, distances_);
    for (uint32_t i = 0; i < kBlockBrickCount; ++i) {
      const auto at = morton_decode(i);
      BrickPlanes planes{};
      for (uint32_t cell = 0; cell < 512; ++cell) {
        const uint32_t x = at[0] * 8 + cell % 8, y = at[1] * 8 + cell / 8 % 8,
                       z = at[2] * 8 + cell / 64;
        const uint32_t squared = distances_[(z * kSide + y) * kSide + x];
        if (squared <= limit_) planes[cell / 64] |= uint64_t{1} << (cell % 64);
      }
      near[i] = brick_of_planes(planes);
    }
  }

 private:
  void fill_row(const glm::ivec3& first_brick, int y, int z, std::span<uint8_t> row) const {
    const glm::ivec3 halo(halo_);
    for (size_t x = 0; x < row.size(); x += limits::kBrickSide) {
      const BrickMask* mask = surface_.find(
          first_brick + glm::ivec3(static_cast<int>(x), y, z) / limits::kBrickSide - halo);
      uint64_t cells = 0;
      if (mask != nullptr) {
        const auto in_y = static_cast<size_t>(y & 7), in_z = static_cast<size_t>(z & 7);
        const size_t octant = (in_z & 4) | (in_y & 4) / 2;
        const int place = brick_layout::kPlaceY[in_y & 3] + brick_layout::kPlaceZ[in_z & 3];
        cells = brick_layout::gather_x(mask->words[octant] >> place) |
                brick_layout::gather_x(mask->words[octant + 1] >> place) << 4;
      }
      for (size_t i = 0; i < limits::kBrickSide; ++i) {
        row[x + i] = static_cast<uint8_t>(cells >> i & 1);
      }
    }
  }

  const BrickIndex& surface_;
  double thickness_;
  int64_t limit_;
  int halo_;  // bricks
  DistanceScratch scratch_;
  std::vector<uint32_t> distances_;
};

// Filters the bricks of one block of a tile, one after the other.
class BlockFilter {
 public:
  BlockFilter(ShellBlock& block, const glm::ivec3& first_brick)
      : block_(block), first_(first_brick) {
    block_.classify(first_, nearness_);
  }

  // The cells of the brick that are near.
  BrickMask kept(uint32_t brick, const BrickMask& cells) {
    if (nearness_[brick] == Nearness::kNear) return cells;
    if (nearness_[brick] == Nearness::kFar) return {};
    if (!have_cells_) block_.near_cells(first_, near_);
    have_cells_ = true;
    BrickMask mask = cells;
    for (size_t w = 0; w < 8; ++w) mask.words[w] &= near_[brick].words[w];
    return mask;
  }

 private:
  ShellBlock& block_;
  glm::ivec3 first_;
  std::array<Nearness, kBlockBrickCount> nearness_{};
  std::array<BrickMask, kBlockBrickCount> near_{};
  bool have_cells_ = false;
};

SparseTile shell_of_tile(const SparseTile& inside, ShellBlock& block) {
  SparseTile out;
  out.coord = inside.coord;
  const glm::ivec3 tile_brick =
      glm::ivec3(inside.coord[0], inside.coord[1], inside.coord[2]) * kTileBricks;
  std::unique_ptr<BlockFilter> filter;
  uint32_t filter_block = UINT32_MAX;
  for_each_brick(inside, [&](uint32_t morton, const BrickMask& cells, size_t) {
    const auto number = static_cast<uint32_t>(morton / kBlockBrickCount);
    if (number != filter_block) {
      cancel_point();
      const auto at = morton_decode(number);
      filter = std::make_unique<BlockFilter>(
          block, tile_brick + glm::ivec3(at[0], at[1], at[2]) * kBlockSideBricks);
      filter_block = number;
    }
    const BrickMask kept = filter->kept(static_cast<uint32_t>(morton % kBlockBrickCount), cells);
    if (std::ranges::all_of(kept.words, [](uint64_t word) { return word == 0; })) return;
    out.brick_morton.push_back(morton);
    out.masks.push_back(kept);
  });
  canonicalize(out);
  return out;
}

glm::ivec3 dims_of(std::span<const SparseTile> a, std::span<const SparseTile> b) {
  glm::ivec3 tiles(1);
  for (const auto& list : {a, b}) {
    for (const SparseTile& tile : list) {
      tiles = glm::max(tiles, glm::ivec3(tile.coord[0], tile.coord[1], tile.coord[2]) + 1);
    }
  }
  return tiles * limits::kTileSide;
}

}  // namespace

int64_t squared_limit(double thickness) {
  const double squared = thickness * thickness;
  const auto limit = static_cast<int64_t>(std::floor(squared));
  // If the product was rounded up to an integer, that integer is above thickness^2.
  const bool above =
      static_cast<double>(limit) == squared && std::fma(thickness, thickness, -squared) < 0;
  return above ? limit - 1 : limit;
}

Status keep_shell(std::span<const SparseTile> surface, double thickness, ThreadTeam& team,
                  const ColumnProgress& progress, std::vector<SparseTile>& inside) {
  const BrickIndex index(surface, dims_of(surface, inside));
  std::vector<ShellBlock> blocks(static_cast<size_t>(team.threads()), ShellBlock(index, thickness));
  const size_t step = blocks.size();
  for (size_t first = 0; first < inside.size(); first += step) {
    std::atomic<size_t> next = first;
    const size_t last = std::min(first + step, inside.size());
    team.run(team.threads(), [&](int worker) {
      for (size_t i = next++; i < last; i = next++) {
        inside[i] = shell_of_tile(inside[i], blocks[static_cast<size_t>(worker)]);
      }
    });
    if (progress) VOXELD_TRY(progress(0));
  }
  std::erase_if(inside, [](const SparseTile& tile) { return tile.empty(); });
  return {};
}

}  // namespace voxeld
