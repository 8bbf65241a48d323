// Which set cell is nearest to each cell of a grid.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include <glm/vec3.hpp>

#include "server/voxel/cpu/worker_pool.h"
#include "server/voxel/solid/brick_index.h"
#include "server/voxel/solid/lower_envelope.h"

namespace voxeld {

// By exact squared distances of centres; of equally near cells the one with the lowest z, then y,
// then x. A feature transform along x, y, z in turn, each in linear time (Meijster, Roerdink &
// Hesselink 2000, "A general algorithm for computing distance transforms in linear time"), of a
// slab of cells as wide as a brick at a time, so that memory grows with a side of the grid only.
class NearestCells {
 public:
  static constexpr int kWidth = limits::kBrickSide;

  // The index and what it points to must outlive this.
  NearestCells(const BrickIndex& set, const glm::ivec3& dims, WorkerPool& pool);

  // The slab of cells whose x / kWidth is `slab`. False where no cell of the grid is set.
  bool compute(int slab);
  // Of a cell in the slab.
  glm::ivec3 nearest(const glm::ivec3& cell) const {
    const size_t at = place(cell.x % kWidth, cell.y, cell.z);
    const int z = nearest_z_[at];
    const size_t in_plane = place(cell.x % kWidth, cell.y, z);
    return {nearest_x_[in_plane], nearest_y_[in_plane], z};
  }

  // What it allocates, tables of rows beside the set's bricks not counted.
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

  // Of a row: in the slab bit by bit, and the nearest beside it.
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
  WorkerPool& pool_;
  int brick_rows_;                        // along y
  std::vector<std::vector<Brick>> rows_;  // set bricks along x, ascending
  std::vector<Scratch> scratch_;          // per thread
  // By place(): squared distance in the plane z, the cell that has it; the plane of the nearest.
  std::vector<uint32_t> squared_;
  std::vector<int16_t> nearest_x_, nearest_y_, nearest_z_;
};

}  // namespace voxeld
