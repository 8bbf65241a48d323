// A cube of cells, one bit each. A margin of empty cells around it lets readers fetch neighbours
// without a bounds check.
//
//   row (y, z): 2 bytes of margin, the cells x = 0..side-1 from the lowest bit up, 2 bytes of
// margin;
//   rows in ascending y, then z, with 2 rows of margin on each side of both.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "proto/codec/sparse_tile.h"

namespace voxeld {

class BitVolume {
 public:
  static constexpr int kMargin = 2;  // cells in y and z
  static constexpr size_t kRowMarginBytes = 2;

  // Starts empty. `side` is a power of two.
  explicit BitVolume(int side)
      : side_(side),
        stride_(static_cast<size_t>((side + 7) / 8) + 2 * kRowMarginBytes),
        bytes_(static_cast<size_t>(side + 2 * kMargin) * static_cast<size_t>(side + 2 * kMargin) *
               stride_) {}

  int side() const { return side_; }
  size_t row_bytes() const { return stride_ - 2 * kRowMarginBytes; }

  // The byte of cells 0..7 of a row; y and z may be kMargin outside.
  uint8_t* row(int y, int z) { return bytes_.data() + offset(y, z); }
  const uint8_t* row(int y, int z) const { return bytes_.data() + offset(y, z); }

  bool get(int x, int y, int z) const { return (row(y, z)[x >> 3] >> (x & 7) & 1) != 0; }
  void set(int x, int y, int z) {
    uint8_t& byte = row(y, z)[x >> 3];
    byte = static_cast<uint8_t>(byte | 1u << (x & 7));
  }

 private:
  size_t offset(int y, int z) const {
    const int rows = side_ + 2 * kMargin;
    return static_cast<size_t>((z + kMargin) * rows + y + kMargin) * stride_ + kRowMarginBytes;
  }

  int side_;
  size_t stride_;
  std::vector<uint8_t> bytes_;
};

// Bits x, x+1, ... of a row from the lowest bit up, for -16 <= x < side. 16 bits are valid if x is
// a multiple of 8, at least 9 otherwise.
inline uint32_t row_bits(const uint8_t* row, int x) {
  const uint8_t* at = row + (x >> 3);
  return (at[0] | static_cast<uint32_t>(at[1]) << 8) >> (x & 7);
}

// Writes and reads a brick of 8x8x8 cells. `brick` counts in bricks from the volume's first cell.
void set_brick(BitVolume& volume, const std::array<int, 3>& brick, const BrickMask& mask);
BrickMask brick_at(const BitVolume& volume, const std::array<int, 3>& brick);

// A volume of half the side. A cell is occupied if any of its 8 cells is.
BitVolume halved(const BitVolume& volume);

}  // namespace voxeld
