// Codes the levels of a tile's octree from the top down. The same code writes and reads, so the two
// cannot disagree. `Coder` is RangeEncoder or RangeDecoder: code(bit, p) returns the bit.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

#include "proto/codec/bit_volume.h"
#include "proto/codec/occupancy_context.h"
#include "proto/codec/occupancy_model.h"
#include "proto/codec/range_coder.h"
#include "proto/work_point.h"

namespace voxeld {

// Sets all cells of full nodes. A node is `node_side` cells on a side: 2, 4 or 8.
inline void fill_full(const BitVolume& full, int node_side, BitVolume& cells) {
  for (int z = 0; z < cells.side(); ++z) {
    for (int y = 0; y < cells.side(); ++y) {
      const uint8_t* nodes = full.row(y / node_side, z / node_side);
      uint8_t* row = cells.row(y, z);
      for (int x = 0; x < full.side(); ++x) {
        if ((nodes[x >> 3] >> (x & 7) & 1) == 0) continue;
        uint8_t& byte = row[x * node_side >> 3];
        byte = static_cast<uint8_t>(byte | ((1u << node_side) - 1) << (x * node_side & 7));
      }
    }
  }
}

// Codes the cells of row (y, z) whose parents are occupied and not inside a full node. A full node
// is parents_per_full parents on a side.
template <typename Coder>
void code_row(Coder& coder, OccupancyModel& model, const BitVolume& parents, BitVolume& cells,
              const BitVolume* full, int parents_per_full, int y, int z, uint32_t level_class) {
  const uint8_t* parent_row = parents.row(y >> 1, z >> 1);
  RowContexts contexts(parents, cells, y, z, level_class);
  for (size_t byte = 0; byte < parents.row_bytes(); ++byte) {
    for (uint32_t bits = parent_row[byte]; bits != 0; bits &= bits - 1) {
      const int parent_x = static_cast<int>(8 * byte) + std::countr_zero(bits);
      if (full != nullptr && full->get(parent_x / parents_per_full, (y >> 1) / parents_per_full,
                                       (z >> 1) / parents_per_full)) {
        continue;
      }
      contexts.move_to(parent_x);
      for (uint32_t odd = 0; odd < 2; ++odd) {
        const int x = 2 * parent_x + static_cast<int>(odd);
        if (odd != 0) contexts.first_known(parent_x);
        bool siblings_empty = false;
        const BitContext context = contexts.context(odd, siblings_empty);
        bool bit = true;  // the parent is not empty, so the last of eight cells must be set
        if (!siblings_empty) {
          bit = coder.code(cells.get(x, y, z), model.predict(context));
          model.update(bit);
        }
        if (bit) cells.set(x, y, z);
      }
    }
  }
}

// Codes one level. `cells` is complete when writing; when reading it is empty except in full nodes.
// Cells inside the nodes of `full` (or null) are not coded. Returns false if the bytes ran out.
template <typename Coder>
bool code_level(Coder& coder, OccupancyModel& model, const BitVolume& parents, BitVolume& cells,
                const BitVolume* full, uint32_t level_class) {
  const int parents_per_full = full == nullptr ? 0 : parents.side() / full->side();
  for (int z = 0; z < cells.side(); ++z) {
    for (int y = 0; y < cells.side(); ++y) {
      work_point();
      code_row(coder, model, parents, cells, full, parents_per_full, y, z, level_class);
      if (coder.exhausted()) return false;
    }
  }
  return true;
}

// Codes which occupied nodes of a level are full: one bit each, except inside a full parent.
// `parents_full` is null if no parent is full. Returns false if the bytes ran out.
template <typename Coder>
bool code_full_nodes(Coder& coder, const BitVolume& occupied, const BitVolume* parents_full,
                     BitVolume& full) {
  std::array<AdaptiveBit, 16> models;
  for (int z = 0; z < occupied.side(); ++z) {
    for (int y = 0; y < occupied.side(); ++y) {
      for (int x = 0; x < occupied.side(); ++x) {
        if (!occupied.get(x, y, z)) continue;
        if (parents_full != nullptr && parents_full->get(x >> 1, y >> 1, z >> 1)) continue;
        const bool inside = occupied.get(x - 1, y, z) && occupied.get(x + 1, y, z) &&
                            occupied.get(x, y - 1, z) && occupied.get(x, y + 1, z) &&
                            occupied.get(x, y, z - 1) && occupied.get(x, y, z + 1);
        AdaptiveBit& model =
            models[(full.get(x - 1, y, z) ? 1u : 0u) | (full.get(x, y - 1, z) ? 2u : 0u) |
                   (full.get(x, y, z - 1) ? 4u : 0u) | (inside ? 8u : 0u)];
        const bool bit = coder.code(full.get(x, y, z), std::clamp(model.probability(), 1u, 65535u));
        model.update(bit);
        if (bit) full.set(x, y, z);
      }
    }
    if (coder.exhausted()) return false;
  }
  return true;
}

}  // namespace voxeld
