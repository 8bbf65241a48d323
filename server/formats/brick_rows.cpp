#include "server/formats/brick_rows.h"

#include <array>
#include <bit>

#include "proto/codec/tile_runs.h"
#include "server/base/cancel_point.h"

namespace voxeld {
namespace {

constexpr size_t kBrickWidth = limits::kBrickSide;

size_t bricks_along(const Grid& grid, int axis) {
  return (static_cast<size_t>(grid.spec.dims[axis]) + kBrickWidth - 1) / kBrickWidth;
}

}  // namespace

// Counted first, then placed.
BrickRows::BrickRows(const Grid& grid, int across, int within)
    : rows_in_plane_(bricks_along(grid, within)) {
  const size_t rows = rows_in_plane_ * bricks_along(grid, across);
  const auto plane_axis = static_cast<size_t>(across), row_axis = static_cast<size_t>(within);
  const auto row_of = [&](const std::array<int32_t, 3>& cell) {
    return static_cast<size_t>(cell[plane_axis]) / kBrickWidth * rows_in_plane_ +
           static_cast<size_t>(cell[row_axis]) / kBrickWidth;
  };
  const auto for_each_brick = [&](auto&& visit) {
    for (uint32_t t = 0; t < grid.tiles.size(); ++t) {
      cancel_point();
      const SparseTile& tile = grid.tiles[t];
      uint32_t voxel = 0;
      for (uint32_t b = 0; b < tile.masks.size(); ++b) {
        const std::array<int32_t, 3> cell = brick_cell(tile, tile.brick_morton[b]);
        visit(row_of(cell), Brick{t, b, voxel, cell[0]});
        for (const uint64_t word : tile.masks[b].words) {
          voxel += static_cast<uint32_t>(std::popcount(word));
        }
      }
    }
  };
  const auto for_each_full = [&](auto&& visit) {
    for (const SparseTile& tile : grid.tiles) {
      cancel_point();
      for (const FullNode& node : tile.full) {
        const std::array<int32_t, 3> first = brick_cell(tile, node.brick_morton);
        const int32_t side = limits::kBrickSide << node.level;
        for (int32_t dy = 0; dy < side; dy += limits::kBrickSide) {
          for (int32_t dz = 0; dz < side; dz += limits::kBrickSide) {
            visit(row_of({first[0], first[1] + dy, first[2] + dz}), FullRow{first[0], side});
          }
        }
      }
    }
  };
  const auto sort = [&](auto& sorted, auto&& for_each) {
    sorted.begins.assign(rows + 2, 0);
    for_each([&](size_t row, const auto&) { ++sorted.begins[row + 2]; });
    for (size_t row = 2; row < rows + 2; ++row) sorted.begins[row] += sorted.begins[row - 1];
    sorted.all.resize(sorted.begins[rows + 1]);
    for_each([&](size_t row, const auto& item) { sorted.all[sorted.begins[row + 1]++] = item; });
  };
  sort(bricks_, for_each_brick);
  sort(full_, for_each_full);
}

}  // namespace voxeld
