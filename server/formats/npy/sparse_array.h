// Arrays with a row for each voxel of a grid (layout sparse): its cell, or its samples of a
// channel.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "proto/options/options.h"
#include "server/formats/npy/array_pieces.h"
#include "server/grid/grid.h"

namespace voxeld {

// The voxels of a grid by ascending Morton code of their cells (x lowest), cut into pieces of whole
// bricks that can be visited each by itself.
class VoxelPieces {
 public:
  // Length of a piece, but for the last brick in it.
  static constexpr uint64_t kPieceVoxels = uint64_t{1} << 16;

  explicit VoxelPieces(const Grid& grid);  // which outlives the pieces
  const Grid& grid() const { return *grid_; }
  size_t count() const { return pieces_.size() - 1; }
  uint64_t begin(size_t piece) const { return pieces_[piece].voxels; }  // voxels before it
  uint64_t voxel_count() const { return pieces_.back().voxels; }

  // Calls visit(tile, brick_morton, mask, attribute) for the bricks of a piece in order; attribute:
  // the number, in its tile, of the first voxel with attributes, or kNoAttributes.
  template <typename Visit>
  void for_each_brick(size_t piece, Visit&& visit) const {
    Place at = pieces_[piece].first;
    for (uint32_t i = 0; i < pieces_[piece].bricks; ++i) step(at, visit);
  }

 private:
  struct Place {
    uint32_t tile = 0, mask = 0;   // the next ones
    uint32_t full = 0, brick = 0;  // the next full node, and the bricks of it that are behind
    size_t attribute = 0;
  };
  struct Piece {
    Place first;
    uint32_t bricks = 0;
    uint64_t voxels = 0;  // before it
  };
  static const BrickMask kFullMask;

  // Visits the brick at a place, and moves the place behind it. False: there is none.
  template <typename Visit>
  bool step(Place& at, Visit&& visit) const {
    for (; at.tile < grid_->tiles.size(); at = {at.tile + 1}) {
      const SparseTile& tile = grid_->tiles[at.tile];
      const bool has_mask = at.mask < tile.masks.size();
      if (at.full < tile.full.size() &&
          (!has_mask || tile.full[at.full].brick_morton < tile.brick_morton[at.mask])) {
        const FullNode& node = tile.full[at.full];
        visit(tile, node.brick_morton + at.brick, kFullMask, kNoAttributes);
        if (++at.brick == node.brick_count()) {
          at.brick = 0;
          ++at.full;
        }
        return true;
      }
      if (has_mask) {
        const BrickMask& mask = tile.masks[at.mask];
        visit(tile, tile.brick_morton[at.mask], mask, at.attribute);
        for (const uint64_t word : mask.words) {
          at.attribute += static_cast<size_t>(std::popcount(word));
        }
        ++at.mask;
        return true;
      }
    }
    return false;
  }

  const Grid* grid_;
  std::vector<Piece> pieces_;  // the last one is empty: the end
};

class SparseArray : public ArrayPieces {
 public:
  // int32 columns x, y, z of the cells; with a frame, its number is a column before them. `voxels`
  // outlives the array.
  static SparseArray coords(const VoxelPieces& voxels, std::optional<int32_t> frame);
  // The samples of a channel that the grid has, as DenseArray has them at the voxel's cell.
  SparseArray(const VoxelPieces& voxels, Channel channel, const OutputOptions& options);

  size_t piece_count() const override { return voxels_->count(); }
  uint64_t piece_begin(size_t piece) const override {
    // The end is that of the last piece.
    return voxels_->begin(piece) * row_bytes_;
  }
  void fill(size_t piece, std::span<uint8_t> bytes) const override { fill_(piece, bytes); }
  Repeats repeats() const override { return repeats_; }

 private:
  using Fill = std::function<void(size_t, std::span<uint8_t>)>;
  SparseArray(const VoxelPieces& voxels, size_t row_bytes, const Repeats& repeats, Fill fill)
      : voxels_(&voxels), row_bytes_(row_bytes), repeats_(repeats), fill_(std::move(fill)) {}

  const VoxelPieces* voxels_;
  size_t row_bytes_;
  Repeats repeats_;
  Fill fill_;
};

// The headers of their .npy files.
std::vector<uint8_t> coords_header(uint64_t voxels, bool has_frame);
std::vector<uint8_t> rows_header(uint64_t voxels, Channel channel, const OutputOptions& options);

// Errors: grid-too-large if the arrays of so many voxels, of all frames, are too long.
Status check_sparse(uint64_t voxels, Format format);

}  // namespace voxeld
