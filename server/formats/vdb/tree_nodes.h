// The nodes of a VDB tree with the values of a grid: which entries are children, tiles and inside
// of a surface. Files of OpenVDB and of NanoVDB have the same nodes.
//
// A brick, or a lower node, that is full of equal values is an active tile. So the inside of a
// solid without attributes costs next to nothing.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "server/formats/vdb/grid_values.h"
#include "server/formats/vdb/tree_order.h"

namespace voxeld::vdb {

// The active voxels of a tree.
struct ActiveVoxels {
  uint64_t count = 0;
  Cell min{INT32_MAX, INT32_MAX, INT32_MAX};  // as OpenVDB writes the box of no voxels
  Cell max{INT32_MIN, INT32_MIN, INT32_MIN};  // the last one

  void add(const ActiveVoxels& voxels);
};

// The box of a leaf's voxels. cell: its first.
ActiveVoxels voxels_of(const LeafMask& mask, const Cell& cell);

inline Cell entry_cell(const Cell& node, const Cell& entry, int32_t entry_side) {
  return {node[0] + entry_side * entry[0], node[1] + entry_side * entry[1],
          node[2] + entry_side * entry[2]};
}

// By their bits: a block of equal values is one whose bytes repeat.
template <typename Value>
bool has_same_bits(const Value& a, const Value& b) {
  using Bits = std::array<uint8_t, sizeof(Value)>;
  return std::bit_cast<Bits>(a) == std::bit_cast<Bits>(b);
}

inline float minus(float value) {
  return -value;
}
// Grids of other types have no inside.
template <typename Value>
Value minus(const Value& value) {
  return value;
}

// The voxels of a leaf, by ascending bit of the mask.
template <typename Value>
struct Leaf {
  LeafMask mask;
  size_t count = 0;
  std::array<Value, LeafMask::kBits> values;  // `count` of them

  Leaf(const GridValues<Value>& source, const SparseTile& tile, const LeafPlace& place);

  // Whether it is a tile.
  bool is_uniform() const;
  // The active voxels inside.
  LeafMask negatives() const;
};

// A lower node without the values of its leaves.
template <typename Value>
struct LowerNode {
  LowerMask children, tiles, inside;
  LowerMask first, last;                              // of which the first and last cell is inside
  std::vector<std::pair<size_t, Value>> tile_values;  // by ascending bit
  std::vector<LeafPlace> leaves;                      // the children, by ascending bit
  ActiveVoxels active;
};

template <typename Value>
struct UpperNode {
  UpperMask children, tiles, inside;
  std::vector<Value> tile_values;                  // by ascending bit
  bool first_inside = false, last_inside = false;  // its first and last cell
};

// Value: float, Vec3s or int32_t.
template <typename Value>
class TreeNodes {
 public:
  // A lower node as its upper node sees it.
  struct Summary {
    bool is_tile = false;
    Value tile{};
    bool first_inside = false, last_inside = false;
    ActiveVoxels active;
  };

  // Both outlive the nodes.
  TreeNodes(const TreeOrder& order, const GridValues<Value>& values);

  const TreeOrder& order() const { return order_; }
  const GridValues<Value>& values() const { return values_; }
  const ActiveVoxels& active() const { return active_; }
  // lower: its number in the order.
  const Summary& summary(size_t lower) const { return summaries_[lower]; }

  // With inside entries beyond the grid.
  LowerNode<Value> lower_of(const LowerPlace& place) const;
  // With those within the grid.
  LowerNode<Value> lower_within(const LowerPlace& place) const;
  UpperNode<Value> upper_of(const UpperPlace& place) const;
  // The cells of a leaf without voxels that are inside of the surface.
  LeafMask inside_of(const LowerPlace& lower, const LeafPlace& place,
                     const Leaf<Value>& leaf) const;
  // The first cells of tiles of the root inside of the surface.
  std::vector<Cell> inside_roots() const;

 private:
  Summary summary_of(const LowerPlace& place) const;

  const TreeOrder& order_;
  const GridValues<Value>& values_;
  std::vector<Summary> summaries_;  // of the order's lower nodes
  ActiveVoxels active_;
};

}  // namespace voxeld::vdb
