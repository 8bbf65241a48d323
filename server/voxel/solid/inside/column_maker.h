// The inside of one tile column along z, made tile by tile upwards: the work of one thread of
// InsideFinder.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "server/voxel/solid/inside/axis_crossings.h"
#include "server/voxel/solid/inside/boundary.h"
#include "server/voxel/solid/inside/column_winding.h"
#include "server/voxel/solid/inside/inside.h"
#include "server/voxel/solid/inside/thresholds.h"
#include "server/voxel/solid/inside/tile_bits.h"
#include "server/voxel/solid/inside/tile_sweep.h"
#include "server/voxel/solid/inside/triangle_columns.h"
#include "server/voxel/solid/inside/winding_field.h"

namespace voxeld {

// Data that all columns of a job share.
struct InsidePlan {
  InsidePlan(const InsideJob& job, ThreadTeam& team);

  bool needs_winding() const { return job.sign == Sign::kWinding; }
  bool needs_axes() const { return job.sign == Sign::kMajority; }
  // One past the last tile along z.
  int tiles_z() const { return (job.dims.z + limits::kTileSide - 1) / limits::kTileSide; }

  const InsideJob& job;
  TriangleColumns triangles;                // along z
  std::optional<FillMesh> cones;            // set if the mesh is open and needs_winding()
  std::optional<TriangleColumns> of_cones;  // along z
  std::optional<WindingField> field;
  std::optional<AxisCrossings> along_x, along_y;  // set if needs_axes()
};

// The rows of bricks of a column that one thread handles: part `part` of `parts`.
struct ColumnShare {
  size_t part = 0, parts = 1;
};

// Makes columns. It keeps up to 8 MiB between them. Not thread-safe.
class ColumnMaker {
 public:
  // Adds the inside cells of every tile of the column to tiles[z], in the share's lane. `whole`
  // receives the tiles that are entirely inside, but only if the share is the whole column.
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
            BrickRow& rows, AxisVotes& votes);
  void keep_doubtful(const glm::ivec3& tile, AxisVotes& votes);
  void apply_thresholds(const InsidePlan& plan, const glm::ivec3& tile, int brick_y, int brick_z,
                        BrickRow& rows);

  SweepZ parity_;                    // sweeps the mesh, or the changes of nonzero
  std::unique_ptr<SweepZ> winding_;  // the state is: winding number of mesh and cones > 0
  std::unique_ptr<Axes> axes_;
  const SparseTile* surface_ = nullptr;  // the tile's surface, set only if the axes vote
  ColumnWindow window_;
  std::vector<Crossing> crossings_, changes_;
  TileCrossings parity_crossings_, winding_crossings_;
  ColumnWinding column_winding_;
  Thresholds thresholds_;                                 // those of the tile
  std::vector<std::pair<uint32_t, BrickMask>> doubtful_;  // of the tile, by Morton index
};

}  // namespace voxeld
