// The memory that drawing a grid takes, counted tile by tile before anything is allocated.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/grid/grid.h"

namespace voxeld {

// The largest table: the march on the CPU numbers its words in signed 32 bits.
inline constexpr size_t kDrawnTableBytesMax = (size_t{1} << 31) * sizeof(uint32_t);

// Memory limits of one render.
struct ImageLimits {
  size_t bytes_max = size_t{768} << 20;  // for tiles and the renderer's tables
  // For each single table; see Renderer::table_bytes_max().
  size_t table_bytes_max = kDrawnTableBytesMax;
};

// Bytes of a brick in the renderer's largest table.
inline constexpr size_t kDrawnBrickBytes = 80;

// Counts tiles and the tables that they become (packed_grid.h).
class DrawingCost {
 public:
  void add(const SparseTile& tile);
  bool fits(const ImageLimits& limits) const;
  size_t bytes() const;

 private:
  size_t node_bytes() const;

  size_t tiles_ = 0, bricks_ = 0, blocks_ = 0, values_ = 0, tile_bytes_ = 0;
};

}  // namespace voxeld
