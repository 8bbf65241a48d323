// The nearest set cell of each cell of a grid.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include <glm/vec3.hpp>

#include "server/base/parallel.h"
#include "server/voxel/solid/distance/brick_index.h"
#include "server/voxel/solid/distance/lower_envelope.h"

namespace voxeld {

// Finds nearest cells by exact squared distances of centres. Among equally near cells the one with
// the lowest z wins, then y, then x. It is a feature transform along x, y, z in turn, each in
// linear time (Meijster, Roerdink & Hesselink 2000, "A general algorithm for computing distance
// transforms in linear time"). It works on slabs as wide as a brick, so that memory grows with two
// sides of the grid, not three.
class NearestCells {
 public:
  static constexpr int kWidth = limits::kBrickSide;

  // The index and what it points to must outlive this object.
  NearestCells(const BrickIndex& set, const glm::ivec3& dims, ThreadTeam& team);

  // Computes the slab of cells whose x / kWidth is `slab`. Returns false if no cell of the grid is
  // set.
  bool compute(int slab);
  // The nearest set cell of a cell in the computed slab.
  glm::ivec3 nearest(const glm::ivec3& cell) const {
    const size_t at = place(cell.x % kWidth, cell.y, cell.z);
    const int z = nearest_z_[at];
    const size_t in_plane = place(cell.x % kWidth, cell.y, z);
    return {nearest_x_[in_plane], nearest_y_[in_plane], z};
  }

  // Bytes that the object allocates, without the tables of rows and the set's bricks.
  static int64_t bytes_for(const glm::ivec3& dims) {
    constexpr int64_t kCellBytes = sizeof(uint32_t) + 3 * sizeof(int16_t);
    return int64_t{kWidth} * dims.y * dims.z * kCellBytes;
  }

 private:
  struct Brick {
    int x;
    const BrickMask* mask;
  };
  struct Scratch {
    std::vector<uint32_t> squared;  // kWidth lines
    std::vector<int16_t> x;
    LowerEnvelope envelope;
  };

  // The set cells of a row: one bit for each cell of the slab, and the nearest set cell on either
  // side.
  struct SetCells {
    int left;
    uint32_t own;
    int right;
  };

  size_t place(int x, int y, int z) const {
    return (static_cast<size_t>(x) * static_cast<size_t>(dims_.z) + static_cast<size_t>(z)) *
               static_cast<size_t>(dims_.y) +
           static_cast<size_t>(y);
  }
  size_t row_of_bricks(int y, int z) const {
    return static_cast<size_t>(z / kWidth) * static_cast<size_t>(brick_rows_) +
           static_cast<size_t>(y / kWidth);
  }
  bool run_row(int slab, int y, int z, Scratch& scratch) const;
  void add_row(int slab, int y, const SetCells& set, Scratch& scratch) const;
  void run_plane(int slab, int z, Scratch& scratch);
  void run_lines(int y_begin, int y_end, Scratch& scratch);

  glm::ivec3 dims_;
  ThreadTeam& team_;
  int brick_rows_;                        // number of brick rows along y
  std::vector<std::vector<Brick>> rows_;  // set bricks along x, ascending
  std::vector<Scratch> scratch_;          // per thread
  // Indexed by place(): the squared distance within plane z and the cell at that distance; then the
  // plane of the nearest cell.
  std::vector<uint32_t> squared_;
  std::vector<int16_t> nearest_x_, nearest_y_, nearest_z_;
};

}  // namespace voxeld
