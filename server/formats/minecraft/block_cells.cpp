#include "server/formats/minecraft/block_cells.h"

#include <algorithm>
#include <array>
#include <bit>

namespace voxeld::minecraft {
namespace {

constexpr uint64_t kBrickSide = limits::kBrickSide;

// The voxels of each y among the 4x4x4 of a word: bits of the Morton index are x 0 and 3, y 1 and
// 4, z 2 and 5.
constexpr std::array<uint64_t, 4> kLayers = [] {
  std::array<uint64_t, 4> layers{};
  for (unsigned i = 0; i < 64; ++i) layers[(i >> 1 & 1) | (i >> 3 & 2)] |= uint64_t{1} << i;
  return layers;
}();
// x and z of each voxel of a word.
constexpr std::array<std::array<uint8_t, 2>, 64> kLayerCells = [] {
  std::array<std::array<uint8_t, 2>, 64> cells{};
  for (unsigned i = 0; i < 64; ++i) {
    cells[i] = {static_cast<uint8_t>((i & 1) | (i >> 2 & 2)),
                static_cast<uint8_t>((i >> 2 & 1) | (i >> 4 & 2))};
  }
  return cells;
}();

}  // namespace

BlockCells::BlockCells(const Grid& grid, const VoxelEntries& entries)
    : grid_(grid),
      entries_(entries),
      nx_(static_cast<uint64_t>(grid.spec.dims.x)),
      ny_(static_cast<uint64_t>(grid.spec.dims.y)),
      nz_(static_cast<uint64_t>(grid.spec.dims.z)),
      rows_(grid, 1, 2) {}

void BlockCells::fill(size_t piece, std::vector<uint8_t>& entries) const {
  const uint64_t first = piece * kPieceCells;
  const uint64_t end = std::min(first + kPieceCells, cell_count());
  entries.assign(static_cast<size_t>(end - first), 0);
  const Window window{first, entries};
  // From the row of bricks that has the first cell on.
  const uint64_t first_row = first / nx_, end_row = (end + nx_ - 1) / nx_;
  uint64_t y = first_row / nz_, brick_z = first_row % nz_ / kBrickSide;
  while (y * nz_ + brick_z * kBrickSide < end_row) {
    fill_rows(y, brick_z, window);
    if (++brick_z == rows_.rows_in_plane()) {
      brick_z = 0;
      ++y;
    }
  }
}

// The rows of cells z..z+7 of plane y, as far as the window has them.
void BlockCells::fill_rows(uint64_t y, uint64_t brick_z, const Window& window) const {
  const size_t row = y / kBrickSide * rows_.rows_in_plane() + brick_z;
  const auto begin = static_cast<int64_t>((y * nz_ + brick_z * kBrickSide) * nx_) -
                     static_cast<int64_t>(window.first);
  const auto count = static_cast<int64_t>(window.entries.size());
  const auto nx = static_cast<int64_t>(nx_);
  for (const BrickRows::FullRow& full : rows_.full(row)) {
    for (int64_t z = 0; z < limits::kBrickSide; ++z) {
      const int64_t run = begin + z * nx + full.x;
      const int64_t from = std::clamp<int64_t>(run, 0, count);
      const int64_t to = std::clamp<int64_t>(run + full.length, 0, count);
      std::fill(window.entries.begin() + from, window.entries.begin() + to, entries_.other);
    }
  }
  const size_t half = y % kBrickSide / 4;
  const uint64_t layer = kLayers[y % 4];
  for (const BrickRows::Brick& brick : rows_.bricks(row)) {
    const auto& words = grid_.tiles[brick.tile].masks[brick.index].words;
    const std::vector<uint8_t>& chosen = entries_.tiles[brick.tile];
    size_t voxel = brick.voxel;
    for (size_t w = 0; w < words.size(); ++w) {
      const int64_t x0 = brick.x + (w & 1 ? 4 : 0), z0 = w >> 2 ? 4 : 0;
      for (uint64_t bits = (w >> 1 & 1) == half ? words[w] & layer : 0; bits != 0;
           bits &= bits - 1) {
        const uint64_t below = (bits & -bits) - 1;
        const auto [x, z] = kLayerCells[static_cast<size_t>(std::countr_zero(bits))];
        const int64_t at = begin + (z0 + z) * nx + x0 + x;
        if (at < 0 || at >= count) continue;
        window.entries[static_cast<size_t>(at)] =
            chosen[voxel + static_cast<size_t>(std::popcount(words[w] & below))];
      }
      voxel += static_cast<size_t>(std::popcount(words[w]));
    }
  }
}

}  // namespace voxeld::minecraft
