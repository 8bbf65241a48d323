// The voxels of a grid one by one, for formats with a record for each.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "proto/codec/tile_runs.h"
#include "server/formats/npy/sparse_array.h"

namespace voxeld::points {

// Calls visit(tile, cell, attribute) for the voxels of a piece in order. cell: x, y, z in the grid;
// attribute: the number of the voxel's attributes in the tile, or kNoAttributes.
template <typename Visit>
void for_each_point(const VoxelPieces& voxels, size_t piece, Visit&& visit) {
  voxels.for_each_brick(
      piece, [&](const SparseTile& tile, uint32_t morton, const BrickMask& mask, size_t attribute) {
        const std::array<int32_t, 3> brick = brick_cell(tile, morton);
        for (uint32_t w = 0; w < mask.words.size(); ++w) {
          for (uint64_t bits = mask.words[w]; bits != 0; bits &= bits - 1) {
            const auto at = morton_decode(64 * w + static_cast<uint32_t>(std::countr_zero(bits)));
            const std::array<int32_t, 3> cell = {brick[0] + static_cast<int32_t>(at[0]),
                                                 brick[1] + static_cast<int32_t>(at[1]),
                                                 brick[2] + static_cast<int32_t>(at[2])};
            visit(tile, cell, attribute);
            if (attribute != kNoAttributes) ++attribute;
          }
        }
      });
}

}  // namespace voxeld::points
