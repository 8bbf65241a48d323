// The nodes of a VDB tree with the voxels of a grid, in the order of the file.
//
//   root   4096 cells   an upper node for each cube that has voxels, by x, then y, then z
//   upper    32^3 entries of 128 cells: lower nodes and tiles
//   lower    16^3 entries of 8 cells: leaves and tiles
//   leaf      8^3 cells: a brick of the grid
//
// An octant of a grid's tile is one lower node.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "proto/limits.h"
#include "server/formats/vdb/node_mask.h"
#include "server/grid/grid.h"

namespace voxeld::vdb {

inline constexpr size_t kLeafLog2 = 3, kLowerLog2 = 4, kUpperLog2 = 5;
inline constexpr int32_t kLeafSide = 8, kLowerSide = 128, kUpperSide = 4096;  // cells

using LeafMask = NodeMask<kLeafLog2>;
using LowerMask = NodeMask<kLowerLog2>;
using UpperMask = NodeMask<kUpperLog2>;
using RootMask = NodeMask<2>;  // of the largest grid's upper nodes
static_assert(RootMask::kSide * kUpperSide >= limits::kGridSideMax);
using Cell = std::array<int32_t, 3>;  // of the grid

// A brick with attributes.
struct LeafPlace {
  size_t slot = 0;  // bit of the lower node's masks
  const BrickMask* mask = nullptr;
  size_t attribute = 0;  // the first voxel's, in the tile
};

struct LowerPlace {
  Cell cell{};      // its first
  size_t slot = 0;  // bit of the upper node's masks
  const SparseTile* tile = nullptr;
  size_t mask_begin = 0, mask_end = 0, attribute = 0;
  size_t full_begin = 0, full_end = 0;
  bool is_full = false;  // of a full node of this size or larger

  // The bricks with attributes, ascending by slot.
  std::vector<LeafPlace> leaves() const;
  // The bricks of full nodes.
  LowerMask full_bricks() const;
};

struct UpperPlace {
  Cell cell{};
  size_t begin = 0, end = 0;  // of its lower nodes
};

class TreeOrder {
 public:
  // The grid outlives the order.
  explicit TreeOrder(const Grid& grid);

  const Grid& grid() const { return grid_; }
  const std::vector<LowerPlace>& lowers() const { return lowers_; }
  const std::vector<UpperPlace>& uppers() const { return uppers_; }
  // The entries of a node of which a part is in the grid, along each axis. entry_side: in cells.
  Cell sides_within(const Cell& node_cell, int32_t entry_side) const;

 private:
  void add_tile(const SparseTile& tile);

  const Grid& grid_;
  std::vector<LowerPlace> lowers_;
  std::vector<UpperPlace> uppers_;
};

// The mask of a leaf, whose bits have z lowest, of a brick's, which is in Morton order.
LeafMask leaf_mask(const BrickMask& mask);
// The bit of a leaf's mask of the voxel with this Morton index.
size_t leaf_bit(size_t morton);

}  // namespace voxeld::vdb
