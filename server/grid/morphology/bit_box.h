// The occupied cells of a box as rows of bits, for operations on neighbours of cells.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "server/grid/tile_appender.h"
#include "server/grid/tile_source.h"

namespace voxeld {

// A bit for each cell of a box, in rows along x: cell x is bit x % 64 of word x / 64 of its row.
class BitBox {
 public:
  static constexpr int kWordCells = 64;

  // `min` and the size along x are multiples of kWordCells in x; other axes are free.
  explicit BitBox(const CellBox& cells);

  const CellBox& cells() const { return cells_; }
  int words() const { return words_; }  // of a row
  // The row at cell y, z of the grid.
  uint64_t* row(int y, int z) { return &bits_[row_at(y, z)]; }
  const uint64_t* row(int y, int z) const { return &bits_[row_at(y, z)]; }
  bool has_row(int y, int z) const {
    return y >= cells_.min.y && y < cells_.max.y && z >= cells_.min.z && z < cells_.max.z;
  }
  std::vector<uint64_t>& bits() { return bits_; }
  const std::vector<uint64_t>& bits() const { return bits_; }
  // The position of a cell among all of the box, by z, y, x.
  size_t number_of(const glm::ivec3& cell) const {
    return row_at(cell.y, cell.z) * kWordCells + static_cast<size_t>(cell.x - cells_.min.x);
  }

  // Adds the cells of a tile that lie in the box.
  void mark(const SparseTile& tile);
  // The cells of a brick whose first cell is `first`, all of them in the box or beyond its end in y
  // and z.
  BrickMask brick(const glm::ivec3& first) const;

 private:
  size_t row_at(int y, int z) const {
    const auto rows = static_cast<size_t>(cells_.max.y - cells_.min.y);
    const size_t number = static_cast<size_t>(z - cells_.min.z) * rows;
    return (number + static_cast<size_t>(y - cells_.min.y)) * static_cast<size_t>(words_);
  }

  CellBox cells_;
  int words_;
  std::vector<uint64_t> bits_;
};

// The values of a tile's voxels by their cells. The tile must outlive it.
class VoxelLookup {
 public:
  explicit VoxelLookup(const SparseTile& tile);
  const SparseTile& tile() const { return *tile_; }
  // Attributes of the voxel at a Morton code; voxels of full nodes have defaults.
  VoxelValues at(uint32_t code) const;

 private:
  const SparseTile* tile_;
  std::vector<size_t> firsts_;  // voxels before each brick
};

// The first cell of a tile.
glm::ivec3 first_cell_of(const TileCoord& coord);

// The canonical tile of the box's cells at `coord`. Without channels no values are asked for.
SparseTile tile_of_bits(const TileCoord& coord, const BitBox& bits, const ChannelSet& channels,
                        const std::function<VoxelValues(uint32_t code)>& values);

}  // namespace voxeld
