// An index of a grid's bricks by position.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "proto/codec/sparse_tile.h"
#include "server/voxel/solid/inside/tile_bits.h"

namespace voxeld {

// Points into the tiles, which must outlive it. It takes 128 KiB for each tile with bricks.
class BrickIndex {
 public:
  BrickIndex(std::span<const SparseTile> tiles, const glm::ivec3& dims);

  const glm::ivec3& tile_dims() const { return tile_dims_; }
  size_t tile_number(const glm::ivec3& tile) const {
    return static_cast<size_t>((tile.z * tile_dims_.y + tile.y)) *
               static_cast<size_t>(tile_dims_.x) +
           static_cast<size_t>(tile.x);
  }
  // nullptr if the brick is empty or outside the grid. `brick` counts bricks of the grid.
  const BrickMask* find(const glm::ivec3& brick) const;

 private:
  using Slots = std::vector<const BrickMask*>;  // by Morton index in the tile

  glm::ivec3 tile_dims_;
  std::vector<std::unique_ptr<Slots>> slots_;
};

}  // namespace voxeld
