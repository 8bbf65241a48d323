// Codes the levels of a tile's octree, from the top down; the same text writes and reads, so both
// sides cannot disagree. `Coder` is RangeEncoder or RangeDecoder: code(bit, p) returns the bit.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

#include "proto/bit_volume.h"
#include "proto/occupancy_context.h"
#include "proto/occupancy_model.h"
#include "proto/range_coder.h"

namespace voxeld {

// Occupied and full bricks of a part of a tile.
struct BrickVolumes {
  explicit BrickVolumes(int side) : occupied(side), full(side) {}
  BitVolume occupied, full;
  bool has_full = false;
};

// Sets the cells of full bricks. `cells` has brick_side cells to a side of a brick: 2, 4 or 8.
inline void fill_full_bricks(const BrickVolumes& bricks, int brick_side, BitVolume& cells) {
  for (int z = 0; z < cells.side(); ++z) {
    for (int y = 0; y < cells.side(); ++y) {
      const uint8_t* full = bricks.full.row(y / brick_side, z / brick_side);
      uint8_t* row = cells.row(y, z);
      for (int x = 0; x < bricks.full.side(); ++x) {
        if ((full[x >> 3] >> (x & 7) & 1) == 0) continue;
        uint8_t& byte = row[x * brick_side >> 3];
        byte = static_cast<uint8_t>(byte | ((1u << brick_side) - 1) << (x * brick_side & 7));
      }
    }
  }
}

// The cells of row (y, z) whose parents are occupied and not in full bricks. `parents_per_brick` is
// 0 above the bricks.
template <typename Coder>
void code_row(Coder& coder, OccupancyModel& model, const BitVolume& parents, BitVolume& cells,
              const BrickVolumes* bricks, int parents_per_brick, int y, int z,
              uint32_t level_class) {
  const uint8_t* parent_row = parents.row(y >> 1, z >> 1);
  RowContexts contexts(parents, cells, y, z, level_class);
  for (size_t byte = 0; byte < parents.row_bytes(); ++byte) {
    for (uint32_t bits = parent_row[byte]; bits != 0; bits &= bits - 1) {
      const int parent_x = static_cast<int>(8 * byte) + std::countr_zero(bits);
      if (bricks != nullptr &&
          bricks->full.get(parent_x / parents_per_brick, (y >> 1) / parents_per_brick,
                           (z >> 1) / parents_per_brick)) {
        continue;
      }
      contexts.move_to(parent_x);
      for (uint32_t odd = 0; odd < 2; ++odd) {
        const int x = 2 * parent_x + static_cast<int>(odd);
        if (odd != 0) contexts.first_known(parent_x);
        bool siblings_empty = false;
        const BitContext context = contexts.context(odd, siblings_empty);
        bool bit = true;  // a node is not empty
        if (!siblings_empty) {
          bit = coder.code(cells.get(x, y, z), model.predict(context));
          model.update(bit);
        }
        if (bit) cells.set(x, y, z);
      }
    }
  }
}

// Codes one level; `cells` is complete when writing, empty (but for full bricks) when reading.
// False when the bytes ran out.
template <typename Coder>
bool code_level(Coder& coder, OccupancyModel& model, const BitVolume& parents, BitVolume& cells,
                const BrickVolumes* bricks, uint32_t level_class) {
  const int parents_per_brick = bricks == nullptr ? 0 : parents.side() / bricks->full.side();
  const BrickVolumes* skipped = bricks != nullptr && bricks->has_full ? bricks : nullptr;
  for (int z = 0; z < cells.side(); ++z) {
    for (int y = 0; y < cells.side(); ++y) {
      code_row(coder, model, parents, cells, skipped, parents_per_brick, y, z, level_class);
      if (coder.exhausted()) return false;
    }
  }
  return true;
}

// Which occupied bricks are full: one bit whether any is, then one for each.
template <typename Coder>
bool code_full_bricks(Coder& coder, BrickVolumes& bricks) {
  bricks.has_full = coder.code(bricks.has_full, 1u << (kProbabilityBits - 1));
  if (!bricks.has_full) return !coder.exhausted();
  std::array<AdaptiveBit, 16> models;
  const BitVolume& occupied = bricks.occupied;
  for (int z = 0; z < occupied.side(); ++z) {
    for (int y = 0; y < occupied.side(); ++y) {
      for (int x = 0; x < occupied.side(); ++x) {
        if (!occupied.get(x, y, z)) continue;
        const bool inside = occupied.get(x - 1, y, z) && occupied.get(x + 1, y, z) &&
                            occupied.get(x, y - 1, z) && occupied.get(x, y + 1, z) &&
                            occupied.get(x, y, z - 1) && occupied.get(x, y, z + 1);
        AdaptiveBit& model = models[(bricks.full.get(x - 1, y, z) ? 1u : 0u) |
                                    (bricks.full.get(x, y - 1, z) ? 2u : 0u) |
                                    (bricks.full.get(x, y, z - 1) ? 4u : 0u) | (inside ? 8u : 0u)];
        const bool bit =
            coder.code(bricks.full.get(x, y, z), std::clamp(model.probability(), 1u, 65535u));
        model.update(bit);
        if (bit) bricks.full.set(x, y, z);
      }
    }
    if (coder.exhausted()) return false;
  }
  return true;
}

}  // namespace voxeld
