// Visits the voxels of full nodes as runs and the others one by one, to fill arrays. A full node
// then costs as much as its rows, not its voxels.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

#include "proto/codec/sparse_tile.h"

namespace voxeld {

// The first cell, in the grid, of a brick of the tile.
inline std::array<int32_t, 3> brick_cell(const SparseTile& tile, uint32_t brick_morton) {
  const auto brick = morton_decode(brick_morton);
  std::array<int32_t, 3> cell{};
  for (size_t c = 0; c < 3; ++c) {
    cell[c] =
        tile.coord[c] * limits::kTileSide + static_cast<int32_t>(brick[c]) * limits::kBrickSide;
  }
  return cell;
}

// Calls visit(x, y, z, length) for the cells [x, x + length) of each row of each full node.
template <typename Visit>
void for_each_full_run(const SparseTile& tile, Visit&& visit) {
  for (const FullNode& node : tile.full) {
    const auto [x, y, z] = brick_cell(tile, node.brick_morton);
    const int32_t side = limits::kBrickSide << node.level;
    for (int32_t dz = 0; dz < side; ++dz) {
      for (int32_t dy = 0; dy < side; ++dy) visit(x, y + dy, z + dz, side);
    }
  }
}

// Calls visit(x, y, z, voxel_index) for every voxel of the masks in Morton order; voxel_index is
// the index of its attributes.
template <typename Visit>
void for_each_mask_voxel(const SparseTile& tile, Visit&& visit) {
  size_t voxel = 0;
  for (size_t b = 0; b < tile.masks.size(); ++b) {
    const auto [x, y, z] = brick_cell(tile, tile.brick_morton[b]);
    for (uint32_t word = 0; word < 8; ++word) {
      for (uint64_t bits = tile.masks[b].words[word]; bits != 0; bits &= bits - 1) {
        const auto cell = morton_decode(word * 64 + static_cast<uint32_t>(std::countr_zero(bits)));
        visit(x + static_cast<int32_t>(cell[0]), y + static_cast<int32_t>(cell[1]),
              z + static_cast<int32_t>(cell[2]), voxel++);
      }
    }
  }
}

}  // namespace voxeld
