// The palette entry of every cell of a grid, in the order of Minecraft's files, made in pieces:
// only those at hand need memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/formats/brick_rows.h"
#include "server/grid/color/palette_entries.h"
#include "server/grid/grid.h"

namespace voxeld::minecraft {

// Cells are in the order y, z, x: x is fastest. Empty ones have entry 0.
class BlockCells {
 public:
  // Cells of a piece, but for the last one. A multiple of 64, so that pieces begin at a long,
  // whatever the bits of an entry are.
  static constexpr uint64_t kPieceCells = uint64_t{1} << 20;

  // The grid and the entries outlive the cells.
  BlockCells(const Grid& grid, const VoxelEntries& entries);

  uint64_t cell_count() const { return uint64_t{nx_} * ny_ * nz_; }
  size_t piece_count() const {
    return static_cast<size_t>((cell_count() + kPieceCells - 1) / kPieceCells);
  }
  // Replaces `entries` by those of a piece. Thread-safe.
  void fill(size_t piece, std::vector<uint8_t>& entries) const;

 private:
  // Cells of the whole grid that a piece has.
  struct Window {
    uint64_t first;
    std::span<uint8_t> entries;
  };
  void fill_rows(uint64_t y, uint64_t brick_z, const Window& window) const;

  const Grid& grid_;
  const VoxelEntries& entries_;
  uint64_t nx_, ny_, nz_;
  BrickRows rows_;
};

}  // namespace voxeld::minecraft
