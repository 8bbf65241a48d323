#include "server/volumes/dense_cells.h"

#include <algorithm>
#include <string>
#include <utility>

#include "proto/limits.h"

namespace voxeld::volumes {
namespace {

constexpr uint32_t kBrick = limits::kBrickSide;
constexpr uint32_t kGroupWords = kBrick * kBrick;
constexpr uint32_t kBlockGroups = 256;  // 2^20 cells
constexpr uint32_t kTileBricks = limits::kTileSide / limits::kBrickSide;

constexpr uint32_t words_of(uint32_t cells) {
  return (cells + kWordCells - 1) / kWordCells;
}

// The index of a voxel at v < 4 on an axis, in its word of a mask.
constexpr uint32_t index_in_word(uint32_t v, size_t axis) {
  return (v & 1) << axis | (v >> 1) << (3 + axis);
}

uint64_t voxels_of(const BrickMask& mask) {
  uint64_t count = 0;
  for (const uint64_t word : mask.words) count += static_cast<uint64_t>(std::popcount(word));
  return count;
}

}  // namespace

CellBlock::CellBlock(const CellOrder& order, uint32_t rows, bool has_color)
    : words_in_row_(words_of(order.sides[0])), has_color_(has_color) {
  const size_t groups = size_t{rows / kBrick} * words_in_row_;
  words_.resize(groups * kGroupWords);
  is_used_.resize(groups);
  if (has_color) first_colors_.resize(words_.size());
}

void CellBlock::begin(const RowBlock& range) {
  range_ = range;
  for (const uint32_t group : used_) {
    std::fill_n(&words_[size_t{group} * kGroupWords], kGroupWords, uint64_t{0});
    is_used_[group] = 0;
  }
  used_.clear();
  colors_.clear();
}

void CellBlock::add(uint32_t plane, uint32_t row, uint32_t word, uint64_t bits,
                    const CellColor* colors) {
  const uint32_t group = (row - range_.row_begin) / kBrick * words_in_row_ + word;
  if (is_used_[group] == 0) {
    is_used_[group] = 1;
    used_.push_back(group);
  }
  const size_t at = (size_t{group} * kBrick + plane % kBrick) * kBrick + row % kBrick;
  words_[at] |= bits;
  if (!has_color_) return;
  first_colors_[at] = static_cast<uint32_t>(colors_.size());
  colors_.insert(colors_.end(), colors, colors + std::popcount(bits));
}

void CellBlock::add_run(uint32_t plane, uint32_t row, uint32_t begin, uint32_t end) {
  while (begin < end) {
    const uint32_t word = begin / kWordCells;
    const uint32_t stop = std::min(end, (word + 1) * kWordCells);
    const uint64_t ones = ~uint64_t{0} >> (kWordCells - (stop - begin));
    add(plane, row, word, ones << begin % kWordCells);
    begin = stop;
  }
}

DenseCells::DenseCells(const CellOrder& order, bool has_color)
    : order_(order), has_color_(has_color) {
  const uint32_t rows_max = (order.sides[1] + kBrick - 1) / kBrick * kBrick;
  const uint32_t groups_of_rows = std::max(1U, kBlockGroups / words_of(order.sides[0]));
  rows_in_block_ = std::min(rows_max, groups_of_rows * kBrick);
  blocks_in_slab_ = (order.sides[1] + rows_in_block_ - 1) / rows_in_block_;
  slabs_ = (order.sides[2] + kBrick - 1) / kBrick;
  for (size_t i = 0; i < 3; ++i) {
    for (uint32_t v = 0; v < 4; ++v) {
      bits_[i].shift[v] = index_in_word(v, order.axes[i]);
      for (uint32_t nibble = 0; nibble < 16; ++nibble) {
        if ((nibble >> v & 1) != 0) {
          bits_[i].nibble[nibble] |= uint64_t{1} << index_in_word(v, order.axes[i]);
        }
      }
    }
  }
  for (uint32_t code = 0; code < cells_.size(); ++code) {
    const std::array<uint32_t, 3> cell = morton_decode(code);
    cells_[code] = {static_cast<uint8_t>(cell[order.axes[2]] * kBrick + cell[order.axes[1]]),
                    static_cast<uint8_t>(cell[order.axes[0]])};
  }
}

size_t DenseCells::block_of(uint32_t plane, uint32_t row) const {
  return plane / kBrick * blocks_in_slab_ + row / rows_in_block_;
}

RowBlock DenseCells::block(size_t number) const {
  const auto slab = static_cast<uint32_t>(number / blocks_in_slab_);
  const auto in_slab = static_cast<uint32_t>(number % blocks_in_slab_);
  return {slab * kBrick, std::min((slab + 1) * kBrick, order_.sides[2]), in_slab * rows_in_block_,
          std::min((in_slab + 1) * rows_in_block_, order_.sides[1])};
}

bool DenseCells::has_too_many() const {
  return voxels_ > limits::kSparseVoxelsMax;
}

std::unique_ptr<CellBlock> DenseCells::take_cells() {
  {
    const std::lock_guard lock(mutex_);
    if (!idle_.empty()) {
      std::unique_ptr<CellBlock> cells = std::move(idle_.back());
      idle_.pop_back();
      return cells;
    }
  }
  return std::make_unique<CellBlock>(order_, rows_in_block_, has_color_);
}

void DenseCells::give_back(std::unique_ptr<CellBlock> cells) {
  const std::lock_guard lock(mutex_);
  idle_.push_back(std::move(cells));
}

// The mask of brick 0..7 of a group.
BrickMask DenseCells::brick_mask(const uint64_t* words, uint32_t brick) const {
  BrickMask mask;
  const auto& [fastest, between, slowest] = order_.axes;
  for (uint32_t plane = 0; plane < kBrick; ++plane) {
    for (uint32_t row = 0; row < kBrick; ++row) {
      const uint64_t cells = words[plane * kBrick + row] >> kBrick * brick & 0xff;
      if (cells == 0) continue;
      const uint32_t word = plane / 4 << slowest | row / 4 << between;
      const uint32_t shift = bits_[2].shift[plane % 4] + bits_[1].shift[row % 4];
      mask.words[word] |= bits_[0].nibble[cells & 0xf] << shift;
      mask.words[word | 1U << fastest] |= bits_[0].nibble[cells >> 4] << shift;
    }
  }
  return mask;
}

// Appends the colours of the brick's voxels in Morton order.
void DenseCells::add_colors(const CellBlock& cells, uint32_t group, uint32_t brick,
                            const BrickMask& mask, std::vector<uint8_t>& color) const {
  const uint64_t* const words = &cells.words_[size_t{group} * kGroupWords];
  const uint32_t* const first = &cells.first_colors_[size_t{group} * kGroupWords];
  for (uint32_t w = 0; w < mask.words.size(); ++w) {
    for (uint64_t bits = mask.words[w]; bits != 0; bits &= bits - 1) {
      const auto [word, bit] = cells_[w * 64 + static_cast<uint32_t>(std::countr_zero(bits))];
      const uint64_t below = (uint64_t{1} << (kBrick * brick + bit)) - 1;
      const CellColor& value =
          cells.colors_[first[word] + static_cast<uint32_t>(std::popcount(words[word] & below))];
      color.insert(color.end(), value.begin(), value.end());
    }
  }
}

// Adds the eight bricks of a group, which lie in one tile.
void DenseCells::add_bricks(const CellBlock& cells, uint32_t group,
                            std::map<uint32_t, Piece>& pieces) const {
  const uint64_t* const words = &cells.words_[size_t{group} * kGroupWords];
  uint64_t any = 0;
  for (uint32_t w = 0; w < kGroupWords; ++w) any |= words[w];
  std::array<uint32_t, 3> at{};  // in bricks
  at[order_.axes[0]] = group % cells.words_in_row_ * kBrick;
  at[order_.axes[1]] = cells.range_.row_begin / kBrick + group / cells.words_in_row_;
  at[order_.axes[2]] = cells.range_.plane_begin / kBrick;
  Piece& piece =
      pieces[morton_encode(at[0] / kTileBricks, at[1] / kTileBricks, at[2] / kTileBricks)];
  for (uint32_t brick = 0; brick < kBrick; ++brick, ++at[order_.axes[0]]) {
    if ((any >> kBrick * brick & 0xff) == 0) continue;
    const BrickMask mask = brick_mask(words, brick);
    piece.brick_morton.push_back(
        morton_encode(at[0] % kTileBricks, at[1] % kTileBricks, at[2] % kTileBricks));
    piece.masks.push_back(mask);
    if (has_color_) add_colors(cells, group, brick, mask, piece.color);
  }
}

void DenseCells::store(const CellBlock& cells) {
  uint64_t voxels = 0;
  for (const uint32_t group : cells.used_) {
    const uint64_t* const words = &cells.words_[size_t{group} * kGroupWords];
    for (uint32_t w = 0; w < kGroupWords; ++w) {
      voxels += static_cast<uint64_t>(std::popcount(words[w]));
    }
  }
  voxels_ += voxels;
  if (voxels == 0 || has_too_many()) return;
  std::map<uint32_t, Piece> pieces;
  for (const uint32_t group : cells.used_) add_bricks(cells, group, pieces);
  const std::lock_guard lock(mutex_);
  for (auto& [order, piece] : pieces) tiles_[order].push_back(std::move(piece));
}

SparseTile DenseCells::tile_of(uint32_t order, const std::vector<Piece>& pieces) const {
  struct Place {
    uint32_t brick_morton;
    uint32_t number;  // in its piece
    size_t piece;
    size_t color_begin;  // in the piece's
  };
  std::vector<Place> places;
  size_t color_bytes = 0;
  for (size_t p = 0; p < pieces.size(); ++p) {
    size_t color_begin = 0;
    for (uint32_t b = 0; b < pieces[p].masks.size(); ++b) {
      places.push_back({pieces[p].brick_morton[b], b, p, color_begin});
      color_begin += 4 * voxels_of(pieces[p].masks[b]);
    }
    color_bytes += pieces[p].color.size();
  }
  std::ranges::sort(places, {}, &Place::brick_morton);
  SparseTile tile;
  const std::array<uint32_t, 3> coord = morton_decode(order);
  std::ranges::copy(coord, tile.coord.begin());
  tile.brick_morton.reserve(places.size());
  tile.masks.reserve(places.size());
  tile.color.reserve(color_bytes);
  for (const Place& place : places) {
    const BrickMask& mask = pieces[place.piece].masks[place.number];
    tile.brick_morton.push_back(place.brick_morton);
    tile.masks.push_back(mask);
    if (!has_color_) continue;
    const auto from = pieces[place.piece].color.begin() + static_cast<ptrdiff_t>(place.color_begin);
    tile.color.insert(tile.color.end(), from, from + static_cast<ptrdiff_t>(4 * voxels_of(mask)));
  }
  canonicalize(tile);
  return tile;
}

Result<std::vector<SparseTile>> DenseCells::finish(std::string_view name) {
  if (has_too_many()) {
    return Error{ErrorCode::kGridTooLarge, std::string(name) + ": too many voxels",
                 "at most " + std::to_string(limits::kSparseVoxelsMax), "more"};
  }
  std::vector<std::pair<uint32_t, std::vector<Piece>>> pieces;
  for (auto& [order, list] : tiles_) pieces.emplace_back(order, std::move(list));
  tiles_.clear();
  std::vector<SparseTile> tiles(pieces.size());
  ThreadPool::shared().for_each(tiles.size(), [&](size_t i) {
    cancel_point();  // on the calling thread
    tiles[i] = tile_of(pieces[i].first, pieces[i].second);
    pieces[i].second = {};
  });
  return tiles;
}

}  // namespace voxeld::volumes
