// Writes OctoMap's .bt, a maximum-likelihood octree without probabilities. Lines of text:
//
//   # Octomap OcTree binary file   what readers look for
//   # voxeld, ...                  comments: dims, origin, voxel_size, units, transform, offset
//   id OcTree
//   size N                         nodes of the tree, its root and leaves included
//   res S                          edge of a voxel, world units
//   data
//
// then a pruned octree of 16 levels, its inner nodes in preorder; nothing if there are no voxels:
//
//   u16 for each inner node, little-endian: child i = x | y<<1 | z<<2 has bits 2i and 2i+1
//     0 unknown, 1 free (not written), 2 an occupied leaf, 3 an inner node, which follows
//
// The offset is to be added to positions of the file, which has no place for one.
//
// A position p is in the cell with key floor(p / S) + 32768 on each axis; bit 15 - d of the keys
// chooses the child of a node of depth d. Cells without voxels are unknown: the daemon has not seen
// whether a sensor could look into them. Eight occupied siblings are one leaf.
//
// Sources: OctoMap 1.9.7, AbstractOccupancyOcTree::readBinary and OccupancyOcTreeBase's
// readBinaryNode (https://octomap.github.io/octomap/doc/); a test reads the files by its tools.
#include "server/formats/octomap.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "proto/options/values.h"
#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"
#include "server/formats/formats.h"
#include "server/formats/mesh/world_vertices.h"
#include "server/formats/output_file.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld::octomap {
namespace {

constexpr double kPlaceRounding = 1e-9;     // of an offset, in voxels, that counts as none
constexpr uint64_t kNodesMax = UINT32_MAX;  // readers count in 32 bits

constexpr int kTileSide = limits::kTileSide;
constexpr uint32_t kKeyBits = 16;
// Levels of nodes above those that are as large as a tile.
constexpr uint32_t kUpperLevels = kKeyBits - std::bit_width(unsigned{kTileSide}) + 1;
constexpr uint32_t kCellsOfBrick = 512;
constexpr uint16_t kOutside = UINT16_MAX;

enum class NodeState : uint16_t { kUnknown = 0, kOccupied = 2, kInner = 3 };
constexpr uint32_t kAllOccupied = 0xaaaa;  // eight of them

// Eight corners: bit c of an index is the coordinate on axis c.
constexpr size_t kCorners = 8;
constexpr int corner_bit(size_t corner, int axis) {
  return static_cast<int>(corner >> axis & 1);
}

// Nodes of a part of the tree in preorder.
struct Subtree {
  NodeState state = NodeState::kUnknown;  // of its root
  uint64_t nodes = 0;
  std::vector<uint8_t> bytes;
};

// How the nodes of the lattice lie on those of the grid: the first cell of a lattice's node of side
// s is cell `rest` modulo s of the grid, so that it touches two nodes of the grid on each axis
// where that is not 0.
class LatticeShift {
 public:
  // first_key: that of the grid's cell (0,0,0).
  explicit LatticeShift(const glm::ivec3& first_key) {
    for (int axis = 0; axis < 3; ++axis) {
      rest_[static_cast<size_t>(axis)] = static_cast<uint32_t>(-first_key[axis]) % kTileSide;
      // The node of a tile's size at n touches the grid's tiles n - first_tile and the next one.
      first_tile[axis] = (first_key[axis] + kTileSide - 1) / kTileSide;
    }
    for (size_t corner = 0; corner < kCorners; ++corner) fill_corner(corner);
  }

  // Whether nodes of 2^level bricks touch the corner of the 2x2x2 grid's nodes.
  bool touches(uint32_t level, size_t corner) const {
    for (int axis = 0; axis < 3; ++axis) {
      if (corner_bit(corner, axis) == 1 && rest(axis, level) == 0) return false;
    }
    return true;
  }
  // 1: the first half of such a node begins in the second half of the grid's node.
  uint32_t half(int axis, uint32_t level) const {
    return rest(axis, level) >> (level + kBrickBits - 1);
  }

  // Adds the voxels of the brick at a corner to the lattice's brick.
  void add_mask(size_t corner, const BrickMask& mask, BrickMask& to) const {
    for (size_t w = 0; w < mask.words.size(); ++w) {
      for (uint64_t bits = mask.words[w] & windows_[corner].words[w]; bits != 0; bits &= bits - 1) {
        const uint32_t cell = target_[corner][64 * w + static_cast<size_t>(std::countr_zero(bits))];
        to.words[cell / 64] |= uint64_t{1} << cell % 64;
      }
    }
  }
  void add_full(size_t corner, BrickMask& to) const {
    for (size_t w = 0; w < to.words.size(); ++w) to.words[w] |= images_[corner].words[w];
  }

  glm::ivec3 first_tile{0};

 private:
  static constexpr uint32_t kBrickBits = std::bit_width(unsigned{limits::kBrickSide}) - 1;

  uint32_t rest(int axis, uint32_t level) const {
    return rest_[static_cast<size_t>(axis)] & ((1U << (level + kBrickBits)) - 1);
  }

  void fill_corner(size_t corner) {
    for (uint32_t cell = 0; cell < kCellsOfBrick; ++cell) {
      const auto from = morton_decode(cell);
      std::array<uint32_t, 3> to{};
      bool is_inside = true;
      for (int axis = 0; axis < 3; ++axis) {
        const auto c = static_cast<size_t>(axis);
        to[c] = from[c] + static_cast<uint32_t>(limits::kBrickSide * corner_bit(corner, axis)) -
                rest(axis, 0);
        is_inside = is_inside && to[c] < limits::kBrickSide;
      }
      const uint32_t target = is_inside ? morton_encode(to[0], to[1], to[2]) : 0;
      target_[corner][cell] = is_inside ? static_cast<uint16_t>(target) : kOutside;
      if (!is_inside) continue;
      windows_[corner].words[cell / 64] |= uint64_t{1} << cell % 64;
      images_[corner].words[target / 64] |= uint64_t{1} << target % 64;
    }
  }

  std::array<uint32_t, 3> rest_{};  // of a tile
  // For each corner: the cells of its brick that are in the lattice's brick, where they are there,
  // and all of them there.
  std::array<BrickMask, kCorners> windows_{};
  std::array<std::array<uint16_t, kCellsOfBrick>, kCorners> target_{};
  std::array<BrickMask, kCorners> images_{};
};

// A node of a tile's octree: the bricks and full nodes in it.
struct TileNode {
  const SparseTile* tile = nullptr;  // null: empty
  uint32_t first_brick = 0;
  size_t mask_begin = 0, mask_end = 0, full_begin = 0, full_end = 0;
  bool is_full = false;

  static TileNode of(const SparseTile& tile) {
    TileNode node{&tile, 0, 0, tile.masks.size(), 0, tile.full.size(), false};
    node.is_full = !tile.full.empty() && tile.full.front().level == kTileLevels;
    return node;
  }
  bool empty() const { return !is_full && mask_begin == mask_end && full_begin == full_end; }

  // A child of this node of 2^level bricks.
  TileNode child(uint32_t level, uint32_t number) const {
    if (is_full || empty()) return *this;
    TileNode node = *this;
    const uint32_t bricks = 1U << (3 * (level - 1));
    node.first_brick += number * bricks;
    const uint32_t end = node.first_brick + bricks;
    const auto masks = std::span(tile->brick_morton).subspan(0, mask_end);
    const auto mask_at = [&](uint32_t brick) {
      const auto rest = masks.subspan(mask_begin);
      return mask_begin + static_cast<size_t>(std::ranges::lower_bound(rest, brick) - rest.begin());
    };
    const auto full_at = [&](uint32_t brick) {
      const auto rest = std::span(tile->full).subspan(full_begin, full_end - full_begin);
      return full_begin +
             static_cast<size_t>(
                 std::ranges::lower_bound(rest, brick, {}, &FullNode::brick_morton) - rest.begin());
    };
    node.mask_begin = mask_at(node.first_brick);
    node.mask_end = mask_at(end);
    node.full_begin = full_at(node.first_brick);
    node.full_end = full_at(end);
    node.is_full =
        node.full_begin < node.full_end && tile->full[node.full_begin].level == level - 1;
    return node;
  }
};

// The nodes of the grid that one of the lattice touches.
using TileNodes = std::array<TileNode, kCorners>;

// The bits 2i + 1 of the set bits i.
constexpr uint32_t occupied_children(uint32_t mask) {
  uint32_t bits = 0;
  for (uint32_t i = 0; i < 8; ++i) bits |= (mask >> i & 1) << (2 * i + 1);
  return bits;
}
constexpr std::array<uint16_t, 256> kOccupiedChildren = [] {
  std::array<uint16_t, 256> table{};
  for (uint32_t mask = 0; mask < table.size(); ++mask) {
    table[mask] = static_cast<uint16_t>(occupied_children(mask));
  }
  return table;
}();

// Writes the part of the tree under a node that is as large as a tile.
class SubtreeWriter {
 public:
  explicit SubtreeWriter(const LatticeShift& shift) : shift_(shift) {}

  Subtree write(const TileNodes& tiles) {
    tree_ = {};
    tree_.state = add_node(kTileLevels, tiles);
    return std::move(tree_);
  }

 private:
  // A node whose children are being written.
  struct Open {
    size_t byte;
    uint64_t nodes;  // before it
    uint32_t children = 0;

    void add(uint32_t child, NodeState state) {
      children |= static_cast<uint32_t>(state) << (2 * child);
    }
  };

  Open begin() {
    const Open open{tree_.bytes.size(), tree_.nodes++};
    tree_.bytes.resize(open.byte + 2);
    return open;
  }
  // Prunes the node if its children are alike.
  NodeState end(const Open& open) {
    if (open.children == 0 || open.children == kAllOccupied) {
      tree_.bytes.resize(open.byte);
      tree_.nodes = open.nodes;
      return open.children == 0 ? NodeState::kUnknown : leaf();
    }
    tree_.bytes[open.byte] = static_cast<uint8_t>(open.children);
    tree_.bytes[open.byte + 1] = static_cast<uint8_t>(open.children >> 8);
    return NodeState::kInner;
  }
  NodeState leaf() {
    ++tree_.nodes;
    return NodeState::kOccupied;
  }

  NodeState add_node(uint32_t level, const TileNodes& from) {
    bool is_empty = true, is_full = true;
    for (size_t corner = 0; corner < kCorners; ++corner) {
      if (!shift_.touches(level, corner)) continue;
      is_empty = is_empty && from[corner].empty();
      is_full = is_full && from[corner].is_full;
    }
    if (is_empty) return NodeState::kUnknown;
    if (is_full) return leaf();
    if (level == 0) return add_brick(from);
    Open open = begin();
    for (uint32_t child = 0; child < 8; ++child) {
      open.add(child, add_node(level - 1, children_under(level, from, child)));
    }
    return end(open);
  }

  // The children of the grid's nodes that a child of the lattice's node touches.
  TileNodes children_under(uint32_t level, const TileNodes& from, uint32_t child) const {
    TileNodes nodes;
    for (size_t corner = 0; corner < kCorners; ++corner) {
      if (!shift_.touches(level - 1, corner)) continue;
      size_t parent = 0;
      uint32_t number = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const uint32_t at = static_cast<uint32_t>(corner_bit(child, axis)) +
                            static_cast<uint32_t>(corner_bit(corner, axis)) +
                            shift_.half(axis, level);  // 0..3, of the children in a row
        parent |= size_t{at / 2} << axis;
        number |= at % 2 << axis;
      }
      nodes[corner] = from[parent].child(level, number);
    }
    return nodes;
  }

  NodeState add_brick(const TileNodes& from) {
    BrickMask mask;
    for (size_t corner = 0; corner < kCorners; ++corner) {
      const TileNode& node = from[corner];
      if (node.empty() || !shift_.touches(0, corner)) continue;
      if (node.is_full) {
        shift_.add_full(corner, mask);
      } else {
        shift_.add_mask(corner, node.tile->masks[node.mask_begin], mask);
      }
    }
    Open open = begin();
    for (uint32_t w = 0; w < 8; ++w) open.add(w, add_word(mask.words[w]));
    return end(open);
  }

  // A node of 4x4x4 cells.
  NodeState add_word(uint64_t word) {
    if (word == 0) return NodeState::kUnknown;
    if (word == ~uint64_t{0}) return leaf();
    Open open = begin();
    for (uint32_t i = 0; i < 8; ++i) open.add(i, add_byte(static_cast<uint8_t>(word >> (8 * i))));
    return end(open);
  }

  // A node of 2x2x2 cells.
  NodeState add_byte(uint8_t byte) {
    if (byte == 0) return NodeState::kUnknown;
    if (byte == UINT8_MAX) return leaf();
    Open open = begin();
    open.children = kOccupiedChildren[byte];
    tree_.nodes += static_cast<uint64_t>(std::popcount(byte));
    return end(open);
  }

  const LatticeShift& shift_;
  Subtree tree_;
};

// The whole tree: the nodes as large as a tile, by themselves, and those above them.
class LatticeTree {
 public:
  LatticeTree(const Grid& grid, const LatticePlace& place)
      : grid_(grid), shift_(place.first_cell + kLatticeReach) {
    for (const SparseTile& tile : grid.tiles) orders_.push_back(tile_order(tile));
    list_codes();
    subtrees_.resize(codes_.size());
    ThreadPool::shared().for_each(codes_.size(), [&](size_t i) {
      cancel_point();  // on the calling thread
      subtrees_[i] = SubtreeWriter(shift_).write(tiles_under(codes_[i]));
    });
    add_upper(kUpperLevels, 0, codes_.size());
  }

  uint64_t nodes() const { return nodes_; }

  Status append_to(OutputFile& file) const {
    std::vector<uint8_t> upper;
    for (const Part& part : parts_) {
      if (part.subtree == nullptr) {
        upper.push_back(static_cast<uint8_t>(part.children));
        upper.push_back(static_cast<uint8_t>(part.children >> 8));
        continue;
      }
      VOXELD_TRY(file.append(upper));
      upper.clear();
      VOXELD_TRY(file.append(part.subtree->bytes));
    }
    return file.append(upper);
  }

 private:
  // A node above the tiles, or all inner nodes of a subtree.
  struct Part {
    uint32_t children = 0;
    const Subtree* subtree = nullptr;
  };

  // Lists the Morton codes of all nodes that touch a tile.
  void list_codes() {
    for (const SparseTile& tile : grid_.tiles) {
      for (size_t corner = 0; corner < kCorners; ++corner) {
        if (!shift_.touches(kTileLevels, corner)) continue;
        std::array<uint32_t, 3> at{};
        for (int axis = 0; axis < 3; ++axis) {
          const auto c = static_cast<size_t>(axis);
          at[c] = static_cast<uint32_t>(tile.coord[c] + shift_.first_tile[axis] -
                                        corner_bit(corner, axis));
        }
        codes_.push_back(morton_encode(at[0], at[1], at[2]));
      }
    }
    std::ranges::sort(codes_);
    codes_.erase(std::unique(codes_.begin(), codes_.end()), codes_.end());
  }

  TileNodes tiles_under(uint32_t code) const {
    TileNodes nodes;
    const auto at = morton_decode(code);
    for (size_t corner = 0; corner < kCorners; ++corner) {
      std::array<uint32_t, 3> coord{};
      bool is_inside = shift_.touches(kTileLevels, corner);
      for (int axis = 0; axis < 3; ++axis) {
        const auto c = static_cast<size_t>(axis);
        const int tile =
            static_cast<int>(at[c]) - shift_.first_tile[axis] + corner_bit(corner, axis);
        is_inside = is_inside && tile >= 0 && tile < grid_.spec.tile_dims()[axis];
        coord[c] = static_cast<uint32_t>(tile);
      }
      if (!is_inside) continue;
      const uint32_t order = morton_encode(coord[0], coord[1], coord[2]);
      const auto found = std::ranges::lower_bound(orders_, order);
      if (found == orders_.end() || *found != order) continue;
      nodes[corner] = TileNode::of(grid_.tiles[static_cast<size_t>(found - orders_.begin())]);
    }
    return nodes;
  }

  // Adds the node above the subtrees [begin, end), which is as large as 2^level of them.
  NodeState add_upper(uint32_t level, size_t begin, size_t end) {
    if (begin == end) return NodeState::kUnknown;
    if (level == 0) {
      const Subtree& subtree = subtrees_[begin];
      nodes_ += subtree.nodes;
      if (subtree.state == NodeState::kInner) parts_.push_back({0, &subtree});
      return subtree.state;
    }
    const size_t part = parts_.size();
    const uint64_t nodes = nodes_++;
    parts_.emplace_back();
    uint32_t children = 0;
    for (uint32_t child = 0; child < 8; ++child) {
      const auto rest = std::span(codes_).subspan(begin, end - begin);
      const auto found = std::ranges::find_if(
          rest, [&](uint32_t code) { return (code >> (3 * (level - 1)) & 7) > child; });
      const size_t next = begin + static_cast<size_t>(found - rest.begin());
      children |= static_cast<uint32_t>(add_upper(level - 1, begin, next)) << (2 * child);
      begin = next;
    }
    if (children == 0 || children == kAllOccupied) {
      parts_.resize(part);
      nodes_ = nodes + (children == 0 ? 0 : 1);
      return children == 0 ? NodeState::kUnknown : NodeState::kOccupied;
    }
    parts_[part].children = children;
    return NodeState::kInner;
  }

  const Grid& grid_;
  LatticeShift shift_;
  std::vector<uint32_t> orders_;  // of the grid's tiles
  std::vector<uint32_t> codes_;   // of the nodes as large as a tile, ascending
  std::vector<Subtree> subtrees_;
  std::vector<Part> parts_;  // in preorder
  uint64_t nodes_ = 0;
};

std::string header_text(const Grid& grid, const LatticePlace& place, uint64_t nodes) {
  std::string text =
      "# Octomap OcTree binary file\n# voxeld, world = position in this file + offset\n";
  for (const std::string& line : mesh::placement_lines(grid)) text += "# " + line + "\n";
  text += "# offset " + volume::vector_text(place.offset) + "\n";
  text += "id OcTree\nsize " + std::to_string(nodes) + "\n";
  return text + "res " + option_values::to_text(place.cell_size) + "\ndata\n";
}

}  // namespace

LatticePlace lattice_place(const GridSpec& spec) {
  LatticePlace place;
  place.cell_size = spec.voxel_size.x;
  for (int axis = 0; axis < 3; ++axis) {
    const double origin = spec.origin_world[axis];
    const double cell = std::round(origin / place.cell_size);
    if (cell >= -kLatticeReach && cell + spec.dims[axis] <= kLatticeReach) {
      place.first_cell[axis] = static_cast<int>(cell);
    }
    const double offset = origin - place.first_cell[axis] * place.cell_size;
    const bool is_rounding = std::abs(offset) <= kPlaceRounding * place.cell_size;
    place.offset[axis] = is_rounding ? 0.0 : offset;
  }
  return place;
}

std::vector<Warning> lattice_warnings(const GridSpec& spec) {
  const LatticePlace place = lattice_place(spec);
  if (place.offset == glm::dvec3(0)) return {};
  return {{"moved", "bt: positions are multiples of the voxel size, up to " +
                        std::to_string(kLatticeReach) + " voxels from the origin; add " +
                        volume::vector_text(place.offset) + " to those of the file"}};
}

}  // namespace voxeld::octomap

namespace voxeld {

Status encode_bt(const Grid& grid, const OutputOptions& /*options*/, OutputFile& file) {
  using namespace octomap;
  const LatticePlace place = lattice_place(grid.spec);
  const LatticeTree tree(grid, place);
  if (tree.nodes() > kNodesMax) {
    return Error{ErrorCode::kGridTooLarge, "bt: too many nodes",
                 "at most " + std::to_string(kNodesMax), std::to_string(tree.nodes())};
  }
  VOXELD_TRY(file.append(volume::text_bytes(header_text(grid, place, tree.nodes()))));
  return tree.append_to(file);
}

}  // namespace voxeld
