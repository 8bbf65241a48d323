// The dense array of a grid's channel, made in pieces: only those at hand need memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "proto/options/options.h"
#include "server/formats/brick_rows.h"
#include "server/formats/npy/array_pieces.h"
#include "server/grid/grid.h"

namespace voxeld {

// The samples that follow the header of an .npy file, in memory order. Both axis orders have the
// same order of cells, x fastest: C order (z, y, x) or Fortran order (x, y, z). In C order the
// components of a sample are last and fastest; in Fortran order each component is an array of its
// own. As float32: occupancy 0 or 1; colour in linear light, 0..1; unit vectors -1..1; fractions
// 0..1. Ids are integers for every dtype. Distances are float32 for every dtype, in voxels or
// (distance=world) in world units. Cells without attributes, those inside full nodes among them,
// are 0 (colour with alpha 0); there, a fraction is 1 and a distance continues that of the surface.
class DenseArray : public ArrayPieces {
 public:
  // Length of a piece but for the last, if a row of bricks is not longer.
  static constexpr size_t kPieceBytes = size_t{1} << 20;

  // channel: nullopt is occupancy. The grid outlives the array. The array of a band of distances is
  // made at once, because the sign of a cell depends on cells far away.
  DenseArray(const Grid& grid, std::optional<Channel> channel, const OutputOptions& options);

  const std::vector<uint8_t>& header() const { return header_; }

  size_t piece_count() const override { return piece_count_; }
  uint64_t piece_begin(size_t piece) const override;
  void fill(size_t piece, std::span<uint8_t> bytes) const override;
  Repeats repeats() const override {
    return cell_bytes_ == 1 ? Repeats::runs() : Repeats::anywhere();
  }

 private:
  // The rows y..y+7 of a plane z, of a component.
  struct Segment {
    size_t component, z, brick_y;
  };
  size_t segment_begin(size_t segment) const;
  Segment segment(size_t number) const;
  template <typename Writer>
  void fill_segment(const Writer& writer, const Segment& segment, uint8_t* out) const;
  template <typename Writer>
  void fill_with(const Writer& writer, size_t piece, std::span<uint8_t> bytes) const;
  void make_band(float far);

  const Grid& grid_;
  size_t nx_, ny_, nz_;
  size_t components_;  // arrays after each other
  size_t cell_bytes_;  // in each of them
  uint64_t bytes_ = 0;
  size_t segments_ = 0, piece_segments_ = 1, piece_count_ = 0;
  std::vector<uint8_t> header_;
  BrickRows rows_;
  std::function<void(size_t, std::span<uint8_t>)> fill_;
  std::vector<float> band_;
};

}  // namespace voxeld
