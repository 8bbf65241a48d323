// The voxels of a grid as hexahedra whose corners are shared nodes, numbered for formats of finite
// elements.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/formats/bricks/brick_index.h"
#include "server/formats/bricks/voxel_bricks.h"
#include "server/formats/npy/sparse_array.h"

namespace voxeld::cells {

inline constexpr size_t kCorners = 8;
// Voxels of a mesh: then numbers of nodes and offsets of corners fit 32 signed bits.
inline constexpr uint64_t kHexahedraMax = ((uint64_t{1} << 31) - 1) / kCorners;

// Numbers of a hexahedron's nodes, from 0: the lower face (z) counter-clockwise seen from above,
// then the upper one. VTK, Abaqus and CalculiX have this order. Grids are not mirrored (voxel_size
// is positive), so volumes are positive.
using Corners = std::array<uint32_t, kCorners>;

// Each point of the lattice at which a voxel has a corner is one node. Nodes are numbered by
// bricks: tiles in Morton order; in a tile bricks, and in a brick points, by z, y and x. Cells have
// the order of VoxelPieces. About 90 bytes for each brick of nodes are in memory.
class Hexahedra {
 public:
  // Length of a piece of nodes, but for the last brick in it.
  static constexpr uint32_t kPieceNodes = uint32_t{1} << 16;

  // At most kHexahedraMax voxels, which outlive the mesh.
  explicit Hexahedra(const VoxelPieces& voxels);
  const VoxelPieces& voxels() const { return *voxels_; }
  const Grid& grid() const { return voxels_->grid(); }

  uint32_t node_count() const { return node_count_; }
  size_t node_piece_count() const { return piece_bricks_.size() - 1; }
  uint32_t node_begin(size_t piece) const {  // nodes before a piece
    const uint32_t brick = piece_bricks_[piece];
    return brick < bricks_.size() ? bricks_[brick].first_node : node_count_;
  }
  // Calls visit(p) for the nodes of a piece in order; p: x, y, z in grid space.
  template <typename Visit>
  void for_each_node(size_t piece, Visit&& visit) const {
    for (uint32_t b = piece_bricks_[piece]; b < piece_bricks_[piece + 1]; ++b) {
      const Brick& brick = bricks_[b];
      for (int z = 0; z < limits::kBrickSide; ++z) {
        for (uint64_t bits = brick.nodes[static_cast<size_t>(z)]; bits != 0; bits &= bits - 1) {
          const int at = std::countr_zero(bits);
          visit(std::array<int32_t, 3>{brick.first_cell[0] + at % limits::kBrickSide,
                                       brick.first_cell[1] + at / limits::kBrickSide,
                                       brick.first_cell[2] + z});
        }
      }
    }
  }
  // Calls visit(corners) for the voxels of a piece of voxels() in order.
  template <typename Visit>
  void for_each_cell(size_t piece, Visit&& visit) const {
    Numbers numbers{};
    voxels_->for_each_brick(piece, [&](const SparseTile& tile, uint32_t morton,
                                       const BrickMask& mask, size_t) {
      fill_numbers(tile, morton, numbers);
      for (uint32_t w = 0; w < mask.words.size(); ++w) {
        for (uint64_t bits = mask.words[w]; bits != 0; bits &= bits - 1) {
          const auto cell = morton_decode(64 * w + static_cast<uint32_t>(std::countr_zero(bits)));
          const uint32_t* lower = &numbers[(cell[2] * kSide + cell[1]) * kSide + cell[0]];
          const uint32_t* upper = lower + kSide * kSide;
          visit(Corners{lower[0], lower[1], lower[kSide + 1], lower[kSide], upper[0], upper[1],
                        upper[kSide + 1], upper[kSide]});
        }
      }
    });
  }

 private:
  static constexpr size_t kSide = limits::kBrickSide + 1;  // points on a side of a brick of voxels
  using Numbers = std::array<uint32_t, kSide * kSide * kSide>;  // of its points, x fastest

  // The points at the lower corners of a brick's cells.
  struct Brick {
    mesh::Planes nodes{};
    uint32_t first_node = 0;
    std::array<int32_t, 3> first_cell{};
  };

  void find_bricks();
  void mark_corners(const SparseTile& tile, uint32_t morton, const BrickMask& mask);
  void number_nodes();
  // The number of a brick of points at a brick of voxels, or behind it: bit 0 x, 1 y, 2 z.
  uint32_t find(const SparseTile& tile, uint32_t morton, uint32_t around) const;
  void fill_numbers(const SparseTile& tile, uint32_t morton, Numbers& numbers) const;

  const VoxelPieces* voxels_;
  mesh::BrickIndex index_;  // of bricks_
  std::vector<Brick> bricks_;
  std::vector<uint32_t> piece_bricks_;  // where pieces of nodes begin; the last one is the end
  uint32_t node_count_ = 0;
};

// Errors: grid-too-large above kHexahedraMax.
Status check_hexahedra(uint64_t voxels, Format format);

}  // namespace voxeld::cells
