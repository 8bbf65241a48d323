// The blocks that stand for a grid's voxels.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "proto/options/options.h"
#include "server/grid/color/palette_entries.h"
#include "server/grid/grid.h"

namespace voxeld::minecraft {

struct ChosenBlocks {
  // "minecraft:air", then the blocks in use, the most frequent first: their indices have one byte
  // in a schem.
  std::vector<std::string> names;
  std::vector<uint64_t> cells;  // of the grid, for each name
  VoxelEntries entries;         // into `names`, never 0

  uint64_t block_count() const;  // cells that are not air
};

// Chooses from options.blocks by the voxels' colours, with options.dither. Grids without colours
// have those of their labels or materials; without any they are of stone, or of the block nearest
// to a neutral grey where stone is not among the blocks. Voxels of full nodes have the mean colour.
ChosenBlocks choose_blocks(const Grid& grid, const OutputOptions& options);

}  // namespace voxeld::minecraft
