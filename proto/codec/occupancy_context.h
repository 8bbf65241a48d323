// The context in which a cell is coded: the cells before it in the order x, then y, then z, and all
// cells of the level above. The neighbours that are still to come are known only through their
// parents.
#pragma once

#include <array>
#include <cstdint>

#include "proto/codec/bit_volume.h"
#include "proto/codec/occupancy_model.h"

namespace voxeld {

// Contexts of the cells in one row. proto/README.md lists them.
class RowContexts {
 public:
  // `level_class`: 0 for cells, 1 for nodes of 2 cells, 2 for 4, 3 for all larger.
  RowContexts(const BitVolume& parents, const BitVolume& cells, int y, int z, uint32_t level_class)
      : set_base_(level_class << 3 | (z & 1) << 2 | (y & 1) << 1) {
    cells_ = {cells.row(y, z),         cells.row(y - 1, z), cells.row(y - 2, z),
              cells.row(y - 1, z - 1), cells.row(y, z - 1), cells.row(y + 1, z - 1),
              cells.row(y - 1, z - 2), cells.row(y, z - 2), cells.row(y + 1, z - 2)};
    const auto parent = [&](int dy, int dz) { return parents.row((y + dy) >> 1, (z + dz) >> 1); };
    parents_ = {parent(0, 0), parent(1, 0), parent(-1, 1), parent(0, 1),
                parent(1, 1), parent(2, 0), parent(0, 2)};
  }

  // Reads the rows around the cells x = 2 parent_x and x + 1.
  void move_to(int parent_x) {
    for (size_t i = 0; i < cells_.size(); ++i) near_[i] = row_bits(cells_[i], 2 * parent_x - 2);
    for (size_t i = 0; i < parents_.size(); ++i) above_[i] = row_bits(parents_[i], parent_x - 1);
  }

  // Updates the row after cell x became known.
  void first_known(int parent_x) { near_[0] = row_bits(cells_[0], 2 * parent_x - 2); }

  // The context of cell x + `odd`. Sets `siblings_empty` if the parent's other cells come before it
  // and are all empty; the cell is then occupied and needs no bit.
  BitContext context(uint32_t odd, bool& siblings_empty) const {
    const auto near = [&](size_t row, uint32_t first, uint32_t mask) {
      return near_[row] >> (first + odd) & mask;
    };
    // 13 neighbours that share a face, edge or corner.
    const uint32_t touching = near(0, 1, 1) | near(1, 1, 7) << 1 | near(3, 1, 7) << 4 |
                              near(4, 1, 7) << 7 | near(5, 1, 7) << 10;
    // The 11 cells one step further.
    const uint32_t far = near(0, 0, 1) | near(1, 0, 1) << 1 | near(1, 4, 1) << 2 |
                         near(2, 1, 7) << 3 | near(6, 2, 1) << 6 | near(7, 1, 7) << 7 |
                         near(8, 2, 1) << 10;
    const auto above = [&](size_t row, uint32_t mask) { return above_[row] >> odd & mask; };
    // Parents of the neighbours to come, as pairs x - 1, x + 1, or only those that are still to
    // come.
    const uint32_t next_x = above(0, 3) >> 1;
    const uint32_t coming =
        next_x | above(1, 3) << 1 | above(2, 3) << 3 | above(3, 3) << 5 | above(4, 3) << 7;
    const uint32_t faces = next_x | (above_[1] >> 1 & 1) << 1 | (above_[3] >> 1 & 1) << 2;
    const uint32_t faces_far =
        (above_[0] >> 2 & 1) | (above_[5] >> 1 & 1) << 1 | (above_[6] >> 1 & 1) << 2;

    const uint32_t place = (set_base_ & 7) | odd;
    constexpr uint32_t kSiblings = 1u << 0 | 3u << 1 | 3u << 4 | 3u << 7;
    siblings_empty = place == 7 && (touching & kSiblings) == 0;
    constexpr uint32_t kFacesAndEdges = 0x1fff & ~(5u << 4 | 5u << 10);
    BitContext context;
    context.values = {
        place | faces << 3 | (touching & kFacesAndEdges) << 6,
        place | faces << 3 | touching << 6,
        place | faces_far << 3 | coming << 6 |
            ((touching & 1) | (touching >> 2 & 1) << 1 | (touching >> 8 & 1) << 2) << 15,
        place | coming << 3 | touching << 12,
        place | faces << 3 | touching << 6 | far << 19,
    };
    context.weight_set = set_base_ | odd;
    return context;
  }

 private:
  uint32_t set_base_;
  std::array<const uint8_t*, 9> cells_{};
  std::array<const uint8_t*, 7> parents_{};
  std::array<uint32_t, 9> near_{};   // bit 0 is the cell 2 parent_x - 2
  std::array<uint32_t, 7> above_{};  // bit 0 is parent_x - 1
};

}  // namespace voxeld
