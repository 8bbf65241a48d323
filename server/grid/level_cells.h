// Sums over the cubes of one tile that each become one voxel of a level of detail. Cells and
// attributes are in Morton order, so those of a cube are consecutive, and one pass makes all sums.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <utility>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "server/base/cancel_point.h"
#include "server/grid/tile_appender.h"

namespace voxeld {

// Counts cells by id. A cube has few distinct ids.
class IdCounts {
 public:
  void add(uint16_t id, uint64_t cells = 1);
  void add(const IdCounts& other);
  uint16_t most_frequent() const;  // the lowest of equals; 0 if there is none

 private:
  std::vector<std::pair<uint16_t, uint64_t>> counts_;  // ids ascending, none 0
};

// Sums over the occupied cells of one cube. They are integers, so neither order nor grouping of the
// cells changes the result.
struct LevelSums {
  uint64_t cells = 0;               // occupied
  uint64_t colored = 0;             // those with a colour
  uint64_t directed = 0;            // those with a normal
  std::array<uint64_t, 4> color{};  // R, G, B as 16-bit linear light times A, and A
  std::array<int64_t, 3> normal{};
  uint64_t valued = 0;       // those with attributes of any kind
  int64_t distance = 0;      // over valued cells
  bool is_measured = false;  // any has a distance, which is never 0
  uint64_t coverage = 0;     // over valued cells
  IdCounts materials, labels;

  void add(const VoxelValues& values);
  void add(const LevelSums& other);
  // The values of the voxel: mean colour in linear light, rounded as in server/voxel/README.md; the
  // direction of the mean normal, or none if that is shorter than a thousandth; the most frequent
  // id that is not 0 (the lowest of equals); mean distance, in voxels of the level, 1 step at the
  // least; and the coverage of the level's face, or of a solid's voxel, by all its cells.
  VoxelValues mean(int level, bool is_solid) const;
};

// Adds the attributes [first, first + count) of the tile.
void add_values(const SparseTile& tile, size_t first, size_t count, LevelSums& sums);

namespace level_detail {

// Calls part(group, bits) for each non-empty group of 8^level cells of a brick, level 1 or 2.
template <typename Part>
void for_each_group(const BrickMask& mask, int level, Part&& part) {
  for (uint32_t word = 0; word < 8; ++word) {
    const uint64_t bits = mask.words[word];
    if (bits == 0) continue;
    if (level == 2) {
      part(word, bits);
      continue;
    }
    for (uint32_t byte = 0; byte < 8; ++byte) {
      if (const uint64_t some = bits >> (8 * byte) & 0xff; some != 0) part(8 * word + byte, some);
    }
  }
}

}  // namespace level_detail

// Calls emit(code, sums) for each non-empty cube of 2^level cells on a side, in Morton order. code
// is the cube's Morton code in the tile, in cubes; from level 8 on, the tile is (part of) one cube.
// level: 1 to 14.
template <typename Emit>
void for_each_level_cell(const SparseTile& tile, int level, Emit&& emit) {
  LevelSums open;
  uint32_t open_code = 0;
  const auto flush = [&] {
    if (open.cells > 0) emit(open_code, open);
    open = {};
  };
  const auto add = [&](uint32_t code, uint64_t cells, size_t first) {
    if (code != open_code) {
      flush();
      open_code = code;
    }
    open.cells += cells;
    if (first != kNoAttributes) add_values(tile, first, static_cast<size_t>(cells), open);
  };
  for_each_brick(tile, [&](uint32_t brick, const BrickMask& mask, size_t first) {
    cancel_point();
    if (level >= 3) {
      uint64_t cells = 0;
      for (const uint64_t word : mask.words) cells += static_cast<uint64_t>(std::popcount(word));
      add(brick >> (3 * (std::min(level, 8) - 3)), cells, first);
      return;
    }
    level_detail::for_each_group(mask, level, [&](uint32_t group, uint64_t bits) {
      const auto cells = static_cast<uint64_t>(std::popcount(bits));
      add(brick << (9 - 3 * level) | group, cells, first);
      if (first != kNoAttributes) first += static_cast<size_t>(cells);
    });
  });
  flush();
}

}  // namespace voxeld
