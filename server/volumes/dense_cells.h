// Turns the occupied cells of a dense array into sparse tiles, a block of rows at a time on all
// cores. Memory follows the voxels.
//
// A block is eight planes of the array's slowest axis, or what is left of them, by a range of rows
// in each plane. Its cells are bits, 128 KiB of them, until they become bricks:
//
//   plane  the slowest axis        row  the axis between        word  64 cells of the fastest axis
#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "proto/result.h"
#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"

namespace voxeld::volumes {

inline constexpr uint32_t kWordCells = 64;  // cells of a row in a word of bits

using CellColor = std::array<uint8_t, 4>;  // sRGB R, G, B and linear A

// The order of an array's cells, the fastest axis first.
struct CellOrder {
  std::array<uint32_t, 3> sides{};      // cells, each 1..limits::kGridSideMax
  std::array<size_t, 3> axes{0, 1, 2};  // that of the grid, 0..2, of each
};

// Rows [row_begin, row_end) of planes [plane_begin, plane_end).
struct RowBlock {
  uint32_t plane_begin, plane_end, row_begin, row_end;
};

// The cells of one block.
class CellBlock {
 public:
  CellBlock(const CellOrder& order, uint32_t rows, bool has_color);

  // Adds the set bits; bit i is cell 64 * word + i of the row. With colours, each word is added
  // once at most, and `colors` has those of its bits in ascending order.
  void add(uint32_t plane, uint32_t row, uint32_t word, uint64_t bits,
           const CellColor* colors = nullptr);
  // Adds the cells [begin, end) of a row.
  void add_run(uint32_t plane, uint32_t row, uint32_t begin, uint32_t end);

 private:
  friend class DenseCells;
  void begin(const RowBlock& range);

  uint32_t words_in_row_;
  bool has_color_;
  RowBlock range_{};
  // Groups of 64 words, 8 planes of 8 rows; their bits are eight bricks beside each other.
  std::vector<uint64_t> words_;
  std::vector<uint32_t> first_colors_;  // of each word, in colors_
  std::vector<CellColor> colors_;
  std::vector<uint8_t> is_used_;  // by group
  std::vector<uint32_t> used_;    // groups with bits
};

// The bricks of all blocks. read() runs scans on several threads; its methods are called by one.
class DenseCells {
 public:
  DenseCells(const CellOrder& order, bool has_color);

  size_t block_count() const { return blocks_in_slab_ * slabs_; }
  size_t block_of(uint32_t plane, uint32_t row) const;
  RowBlock block(size_t number) const;

  // Calls scan(i, block(number(i)), cells) for i < count on all cores and stores the cells. Each
  // block is scanned once. Does nothing once there are too many voxels.
  template <typename Number, typename Scan>
  void read(size_t count, const Number& number, const Scan& scan) {
    ThreadPool::shared().for_each(count, [&](size_t i) {
      cancel_point();  // on the calling thread
      if (has_too_many()) return;
      std::unique_ptr<CellBlock> cells = take_cells();
      const RowBlock range = block(number(i));
      cells->begin(range);
      scan(i, range, *cells);
      store(*cells);
      give_back(std::move(cells));
    });
  }

  uint64_t voxel_count() const { return voxels_; }
  bool has_too_many() const;
  // The tiles in storage order. Errors: grid-too-large for more than limits::kSparseVoxelsMax
  // voxels.
  Result<std::vector<SparseTile>> finish(std::string_view name);

 private:
  // The bricks of one block in one tile.
  struct Piece {
    std::vector<uint32_t> brick_morton;
    std::vector<BrickMask> masks;
    std::vector<uint8_t> color;
  };
  // The bits of four cells along an axis, and of one cell at 0..3, as they lie in a mask's word.
  struct AxisBits {
    std::array<uint64_t, 16> nibble{};
    std::array<uint32_t, 4> shift{};
  };

  std::unique_ptr<CellBlock> take_cells();
  void give_back(std::unique_ptr<CellBlock> cells);
  void store(const CellBlock& cells);
  void add_bricks(const CellBlock& cells, uint32_t group, std::map<uint32_t, Piece>& pieces) const;
  BrickMask brick_mask(const uint64_t* words, uint32_t brick) const;
  void add_colors(const CellBlock& cells, uint32_t group, uint32_t brick, const BrickMask& mask,
                  std::vector<uint8_t>& color) const;
  SparseTile tile_of(uint32_t order, const std::vector<Piece>& pieces) const;

  CellOrder order_;
  bool has_color_;
  uint32_t rows_in_block_;
  size_t blocks_in_slab_, slabs_;
  std::array<AxisBits, 3> bits_{};                   // fastest axis first
  std::array<std::array<uint8_t, 2>, 512> cells_{};  // by code: the word in its group, the bit

  std::atomic<uint64_t> voxels_{0};
  std::mutex mutex_;
  // Guarded by mutex_.
  std::vector<std::unique_ptr<CellBlock>> idle_;
  std::map<uint32_t, std::vector<Piece>> tiles_;  // by tile_order()
};

}  // namespace voxeld::volumes
