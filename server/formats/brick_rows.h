// The bricks and full nodes of a grid by rows of bricks along x, for encoders that write all cells
// in pieces, plane by plane.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/grid/grid.h"

namespace voxeld {

// A row is 8 rows of cells in 8 planes. Rows are numbered along the axis `within` a plane, then
// along the axis that is `across` the planes.
class BrickRows {
 public:
  struct Brick {
    uint32_t tile, index;  // of its mask
    uint32_t voxel;        // the first of its attributes in the tile
    int32_t x;
  };
  // Cells of full nodes that a row has.
  struct FullRow {
    int32_t x, length;
  };

  // across, within: 1 and 2 (y, z) in any order.
  BrickRows(const Grid& grid, int across, int within);

  size_t rows_in_plane() const { return rows_in_plane_; }
  std::span<const Brick> bricks(size_t row) const { return bricks_.at(row); }
  std::span<const FullRow> full(size_t row) const { return full_.at(row); }

 private:
  template <typename T>
  struct Rows {
    std::vector<size_t> begins;
    std::vector<T> all;
    std::span<const T> at(size_t row) const {
      return std::span(all).subspan(begins[row], begins[row + 1] - begins[row]);
    }
  };

  size_t rows_in_plane_;
  Rows<Brick> bricks_;
  Rows<FullRow> full_;
};

}  // namespace voxeld
