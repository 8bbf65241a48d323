#include "server/formats/minecraft/block_choice.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <numeric>
#include <utility>

#include "proto/minecraft_blocks.h"
#include "server/base/cancel_point.h"
#include "server/formats/mesh/voxel_colors.h"

namespace voxeld::minecraft {
namespace {

constexpr size_t kEntries = 256;  // that a VoxelEntries can name
constexpr std::string_view kPlainBlock = "stone";

// The blocks to choose from.
std::vector<MinecraftBlock> candidates(bool has_colors, const OutputOptions& options) {
  std::vector<MinecraftBlock> blocks = blocks_named(options.blocks);
  const auto plain = std::ranges::find(blocks, kPlainBlock, &MinecraftBlock::name);
  if (!has_colors && plain != blocks.end()) return {*plain};
  return blocks;
}

std::array<uint64_t, kEntries> count_cells(const Grid& grid, const VoxelEntries& entries) {
  std::array<uint64_t, kEntries> cells{};
  for (size_t i = 0; i < grid.tiles.size(); ++i) {
    cancel_point();
    for (const uint8_t entry : entries.tiles[i]) ++cells[entry];
    cells[entries.other] += grid.tiles[i].voxel_count() - entries.tiles[i].size();
  }
  return cells;
}

}  // namespace

uint64_t ChosenBlocks::block_count() const {
  return std::accumulate(cells.begin() + 1, cells.end(), uint64_t{0});
}

ChosenBlocks choose_blocks(const Grid& grid, const OutputOptions& options) {
  const mesh::VoxelColors colors(grid);
  const std::vector<MinecraftBlock> blocks = candidates(colors.several(), options);
  std::vector<Rgb> block_colors;
  block_colors.reserve(blocks.size());
  for (const MinecraftBlock& block : blocks) block_colors.push_back(block.color);

  ChosenBlocks chosen;
  chosen.entries =
      choose_entries(grid, block_colors, options.dither, [&](const SparseTile& tile, size_t voxel) {
        const bool is_inner = voxel != kNoAttributes && !colors.has_own(tile, voxel);
        return is_inner ? kNoColorKey : colors.of(tile, voxel) & 0xffffff;  // without alpha
      });
  const std::array<uint64_t, kEntries> cells = count_cells(grid, chosen.entries);
  std::vector<size_t> used;
  for (size_t i = 0; i < blocks.size(); ++i) {
    if (cells[i] > 0) used.push_back(i);
  }
  std::ranges::stable_sort(used, [&](size_t a, size_t b) { return cells[a] > cells[b]; });

  std::array<uint8_t, kEntries> index_of{};
  chosen.names = {"minecraft:air"};
  chosen.cells = {static_cast<uint64_t>(grid.spec.cell_count())};
  for (const size_t i : used) {
    index_of[i] = static_cast<uint8_t>(chosen.names.size());
    chosen.names.push_back("minecraft:" + std::string(blocks[i].name));
    chosen.cells.push_back(cells[i]);
    chosen.cells[0] -= cells[i];
  }
  for (auto& tile : chosen.entries.tiles) {
    cancel_point();
    for (uint8_t& entry : tile) entry = index_of[entry];
  }
  chosen.entries.other = index_of[chosen.entries.other];
  return chosen;
}

}  // namespace voxeld::minecraft
