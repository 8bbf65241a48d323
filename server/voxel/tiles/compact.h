// Conversion between the mask of a tile, as the device writes it, and sparse bricks.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/codec/sparse_tile.h"

namespace voxeld {

// Appends the occupied bricks of `blocks` (TileWindow::blocks) to `tile` and returns the number of
// voxels. word_offsets: empty, or kTileMaskWords elements; then each nonzero word's element is set
// to the number of voxels before it.
uint64_t compact_mask(std::span<const uint32_t> mask, uint64_t blocks, SparseTile& tile,
                      std::span<uint32_t> word_offsets);

// The reverse: sets a mask (kTileMaskWords words) to exactly the voxels of `tile`.
void expand_mask(const SparseTile& tile, std::span<uint32_t> mask);

// Computes word_offsets and `blocks` for bricks that were compacted elsewhere, as compact_mask()
// would set them. Returns the number of voxels.
uint64_t number_words(const SparseTile& tile, std::span<uint32_t> word_offsets, uint64_t& blocks);

}  // namespace voxeld
