// The mask of a tile as the device left it -> sparse bricks.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/sparse_tile.h"

namespace voxeld {

// Appends the occupied bricks of `blocks` (TileWindow::blocks) to `tile`. Returns the number of
// voxels. Where `word_offsets` is not empty (kTileMaskWords), sets it for every word that is not 0
// to the number of voxels before it.
uint64_t compact_mask(std::span<const uint32_t> mask, uint64_t blocks, SparseTile& tile,
                      std::span<uint32_t> word_offsets);

// The reverse: sets the words of a mask (kTileMaskWords) to the voxels of `tile`, all others to 0.
void expand_mask(const SparseTile& tile, std::span<uint32_t> mask);

// For bricks that were compacted elsewhere: the same word_offsets of the words of `tile`, and the
// `blocks` that its bricks are in. Returns the number of voxels.
uint64_t number_words(const SparseTile& tile, std::span<uint32_t> word_offsets, uint64_t& blocks);

}  // namespace voxeld
