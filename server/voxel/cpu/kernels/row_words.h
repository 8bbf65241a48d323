// Short runs of cells along x in words of rows, one write each, and the conversion of rows to the
// Morton order of bricks.
//
// Row (y, z) of a block of 64^3 cells is one word of 64 cells along x. The rows of a block are
// consecutive, y first, and blocks are in Morton order. The cells of a small triangle lie in a few
// cache lines, and a run continues in another word only where blocks meet.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/base/simd/lanes.h"
#include "server/voxel/cpu/kernels/touch_kernel.h"

namespace voxeld {
namespace {

// The terms of a row's word number, which is the sum of those of x, y and z. Bits 6 and 7 of a
// coordinate are its block's. Bits 12.. of the number are x0 y0 z0 x1 y1 z1 of the block.
template <typename T>
T row_word_x(T x) {
  return (x << 6 & 0x1000) | (x << 8 & 0x8000);
}
template <typename T>
T row_word_y(T y) {
  return (y & 63) | (y << 7 & 0x2000) | (y << 9 & 0x10000);
}
template <typename T>
T row_word_z(T z) {
  return (z & 63) << 6 | (z << 8 & 0x4000) | (z << 10 & 0x20000);
}

// Sets cells [begin, end), 1 to 63 of them, of the row whose word at x = 0 is number `row`.
inline void set_row(uint64_t* rows, uint32_t row, uint32_t begin, uint32_t end) {
  const uint64_t run = (uint64_t{1} << (end - begin)) - 1;
  rows[row + row_word_x(begin)] |= run << (begin & 63);
  if ((begin ^ (end - 1)) > 63) rows[row + row_word_x(end - 1)] |= run >> (64 - (begin & 63));
}

// Sets a run for each lane that is -1 in `wanted`, not 0. The other lanes write nothing to words of
// their own, which is cheaper than an unpredictable branch.
inline void set_rows(uint64_t* rows, IntLanes row, IntLanes begin, IntLanes end, IntLanes wanted) {
  alignas(64) uint32_t numbers[kLanes], shifts[kLanes], lengths[kLanes];
  const IntLanes last = end - 1, shift = begin & 63, length = (end - begin) & wanted;
  const IntLanes number = wanted ? row + row_word_x(begin) : lane_numbers() + kUnusedRow;
  __builtin_memcpy(numbers, &number, sizeof number);
  __builtin_memcpy(shifts, &shift, sizeof shift);
  __builtin_memcpy(lengths, &length, sizeof length);
  for (int l = 0; l < kLanes; ++l) {
    rows[numbers[l]] |= ((uint64_t{1} << lengths[l]) - 1) << shifts[l];
  }
  uint32_t crossing = negative_lanes(wanted & (63 - (begin ^ last)));
  if (crossing == 0) return;
  const IntLanes next = row + row_word_x(last);
  __builtin_memcpy(numbers, &next, sizeof next);
  for (; crossing != 0; crossing &= crossing - 1) {
    const int l = __builtin_ctz(crossing);
    rows[numbers[l]] |= ((uint64_t{1} << lengths[l]) - 1) >> (64 - shifts[l]);
  }
}

using Word4 = uint64_t __attribute__((vector_size(32)));

inline Word4 load4(const uint64_t* words) {
  Word4 v;
  __builtin_memcpy(&v, words, sizeof v);
  return v;
}
inline uint64_t any_of4(Word4 v) {
  return (v[0] | v[1]) | (v[2] | v[3]);
}

// Exchanges binary digits i < j of the 6-digit places of all 64 bits (Knuth, TAOCP 4A, 7.1.3, delta
// swaps).
template <int i, int j>
Word4 swap_digits(Word4 words) {
  constexpr uint64_t kLower = [] {
    uint64_t mask = 0;
    for (int place = 0; place < 64; ++place) {
      if ((place >> i & 1) == 1 && (place >> j & 1) == 0) mask |= uint64_t{1} << place;
    }
    return mask;
  }();
  constexpr int kShift = (1 << j) - (1 << i);
  const Word4 moved = (words ^ words >> kShift) & kLower;
  return words ^ moved ^ moved << kShift;
}

// A slice at one z of brick bx, of the 8 in a row of bricks, from its 8 rows of 64 cells. Cell (x,
// y) is bit x + 8 y.
inline uint64_t brick_slice(const uint64_t* rows, int bx) {
  const Word4 low = (load4(rows) >> 8 * bx & 0xff) << Word4{0, 8, 16, 24};
  const Word4 high = (load4(rows + 4) >> 8 * bx & 0xff) << Word4{32, 40, 48, 56};
  return any_of4(low | high);
}

// Converts four slices, z = 0..3, to the four words of Morton order that they make: 2x2 of 4x4x4
// cells.
inline Word4 morton_words(Word4 slices) {
  // Reorders the digits of places from x0 x1 x2 y0 y1 y2 to x0 y0 x1 y1 x2 y2.
  slices = swap_digits<1, 3>(slices);
  slices = swap_digits<2, 3>(slices);
  slices = swap_digits<3, 4>(slices);
  // Word x2 y2 takes its 16 bits of each slice. They are x0 y0 x1 y1 z0 z1, then reordered to x0 y0
  // z0 x1 y1 z1.
  Word4 words{};
  for (int z = 0; z < 4; ++z) {
    words |= ((Word4{} + slices[z]) >> Word4{0, 16, 32, 48} & 0xffff) << 16 * z;
  }
  words = swap_digits<2, 4>(words);
  return swap_digits<3, 4>(words);
}

// ORs the brick at cell (8 bx, 8 by, 8 bz) of a block of rows into 8 words of Morton order.
inline void add_brick_of_rows(const uint64_t* block, int bx, int by, int bz, uint64_t* brick) {
  const uint64_t* rows = block + ptrdiff_t{512} * bz + ptrdiff_t{8} * by;
  for (ptrdiff_t half = 0; half < 2; ++half) {
    Word4 slices;
    for (int z = 0; z < 4; ++z) slices[z] = brick_slice(rows + (4 * half + z) * 64, bx);
    const Word4 words = load4(brick + 4 * half) | morton_words(slices);
    __builtin_memcpy(brick + 4 * half, &words, sizeof words);
  }
}

// Occupancy of a row of bricks: byte bx is nonzero if brick bx holds any cell.
inline uint64_t any_in_bricks(const uint64_t* block, int by, int bz) {
  Word4 any{};
  const uint64_t* rows = block + ptrdiff_t{512} * bz + ptrdiff_t{8} * by;
  for (int z = 0; z < 8; ++z, rows += 64) {
    any |= load4(rows) | load4(rows + 4);
  }
  return any_of4(any);
}

}  // namespace
}  // namespace voxeld
