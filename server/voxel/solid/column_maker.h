// The inside of one tile column along z, tile by tile upwards: what a thread of find_inside() does.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/voxel/solid/axis_crossings.h"
#include "server/voxel/solid/boundary.h"
#include "server/voxel/solid/column_winding.h"
#include "server/voxel/solid/inside.h"
#include "server/voxel/solid/thresholds.h"
#include "server/voxel/solid/tile_bits.h"
#include "server/voxel/solid/tile_sweep.h"
#include "server/voxel/solid/triangle_columns.h"
#include "server/voxel/solid/winding_field.h"

namespace voxeld {

// What all columns of a job share.
struct InsidePlan {
  InsidePlan(const InsideJob& job, WorkerPool& pool);

  bool needs_winding() const { return job.sign == Sign::kWinding || job.sign == Sign::kAuto; }
  bool needs_axes() const { return job.sign == Sign::kMajority || job.sign == Sign::kAuto; }
  // One past the last tile along z.
  int tiles_z() const { return (job.dims.z + limits::kTileSide - 1) / limits::kTileSide; }

  const InsideJob& job;
  TriangleColumns triangles;                // along z
  std::optional<FillMesh> cones;            // of an open mesh, where needs_winding()
  std::optional<TriangleColumns> of_cones;  // along z
  std::optional<WindingField> field;
  std::optional<AxisCrossings> along_x, along_y;  // where needs_axes()
};

// Rows of bricks of a column that one thread does: part of parts.
struct ColumnShare {
  size_t part = 0, parts = 1;
};

// Keeps up to 8 MiB between columns. One thread.
class ColumnMaker {
 public:
  // Adds the cells inside of every tile of the column to tiles[z], in the share's lane. `whole`:
  // tiles that are inside altogether, where the share is the whole column.
  void run(const InsidePlan& plan, size_t column, const ColumnShare& share,
           std::span<TileBits> tiles, std::vector<int>& whole, AxisVotes& votes);

 private:
  struct Axes {
    SweepX x;
    SweepY y;
  };

  void find_crossings(const InsidePlan& plan, size_t column, const ColumnWindow& window);
  void begin_axes(const InsidePlan& plan, const glm::ivec3& tile);
  void make_tile(const InsidePlan& plan, const glm::ivec3& tile, const ColumnShare& share,
                 const TileExtent& extent, TileBits& out, AxisVotes& votes);
  void vote(const InsidePlan& plan, const glm::ivec3& tile, int brick_y, int brick_z,
            BrickRow& rows, BrickRow& disagree, AxisVotes& votes);
  void apply_thresholds(const InsidePlan& plan, const glm::ivec3& tile, int brick_y, int brick_z,
                        const BrickRow* wanted, BrickRow& rows);

  SweepZ parity_;                    // of the mesh, or of changes of nonzero
  std::unique_ptr<SweepZ> winding_;  // winding number of mesh and cones > 0
  std::unique_ptr<Axes> axes_;
  const SparseTile* surface_ = nullptr;  // of the tile, where the axes vote
  ColumnWindow window_;
  std::vector<Crossing> crossings_, changes_;
  TileCrossings parity_crossings_, winding_crossings_;
  ColumnWinding column_winding_;
  Thresholds thresholds_;  // of the tile
};

}  // namespace voxeld
