#include "server/voxel/solid/solid_filler.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include "server/base/clock.h"
#include "server/voxel/pipelines/fallback.h"
#include "server/voxel/solid/distance/distance_field.h"
#include "server/voxel/solid/distance/distance_maker.h"
#include "server/voxel/solid/flood.h"
#include "server/voxel/solid/inside/boundary.h"
#include "server/voxel/solid/interior.h"
#include "server/voxel/solid/merge.h"
#include "server/voxel/solid/shell.h"

namespace voxeld {
namespace {

// The cells of rule=touch: the surface itself if that is the plan's rule, else made on demand.
class TouchCells {
 public:
  TouchCells(const VoxelizePlan& plan, const std::vector<SparseTile>& surface)
      : surface_(plan.options.rule == Rule::kTouch ? &surface : nullptr) {}

  Result<const std::vector<SparseTile>*> get(const SolidFiller::TouchTiles& make) {
    if (surface_ != nullptr) return surface_;
    VOXELD_ASSIGN(made_, make());
    return &made_;
  }

 private:
  const std::vector<SparseTile>* surface_;
  std::vector<SparseTile> made_;
};

double total(const StageTimes& passes) {
  double ms = 0;
  for (const auto& pass : passes) ms += pass.second;
  return ms;
}

}  // namespace

SolidFiller::Choice SolidFiller::choose(const VoxelizePlan& plan, const FillMesh& mesh,
                                        FillStats& fill) const {
  fill.sign = plan.options.sign;
  fill.reason = "asked for";
  if (fill.sign != Sign::kAuto && fill.sign != Sign::kWinding) return {fill.sign, false};
  const auto edges = static_cast<int64_t>(boundary_edges(mesh).size());
  fill.boundary_edges = edges;
  const bool closed = edges == 0;
  if (plan.options.sign == Sign::kWinding) return {Sign::kWinding, closed};
  if (closed) {
    fill.sign = Sign::kNonzero;
    fill.reason = "nonzero: the mesh is closed and consistently oriented";
    return {Sign::kNonzero, true};
  }
  fill.sign = Sign::kMajority;
  fill.reason = "majority, and winding where the axes disagree: the mesh does not close at " +
                std::to_string(edges) + (edges == 1 ? " edge" : " edges");
  return {Sign::kAuto, false};
}

Result<std::vector<SparseTile>> SolidFiller::inside(const VoxelizePlan& plan, const FillMesh& mesh,
                                                    const TouchTiles& touch,
                                                    const ColumnProgress& progress,
                                                    const std::vector<SparseTile>& surface,
                                                    Sign sign, AxisVotes& votes,
                                                    VoxelizeStats& stats) {
  std::vector<SparseTile> tiles;
  if (sign == Sign::kFlood) {
    TouchCells cells(plan, surface);
    VOXELD_ASSIGN(const auto* touched, cells.get(touch));
    if (device_ != nullptr) {
      const auto done = device_->flood_inside(*touched, plan.spec.dims, progress, tiles, stats);
      if (done.ok() && *done) return tiles;
      if (!done) VOXELD_TRY(fall_back(plan, done.error(), tiles, stats));
    }
    VOXELD_TRY(flood_inside(*touched, plan.spec.dims, progress, tiles));
    return tiles;
  }
  const InsideJob job = {mesh, plan.spec.dims, sign, {surface}};
  if (device_ != nullptr) {
    const Status found = device_->find_inside(job, progress, tiles, votes, stats);
    if (found) return tiles;
    VOXELD_TRY(fall_back(plan, found.error(), tiles, stats));
    votes = {};
  }
  VOXELD_TRY(finder_.find(job, progress, tiles, votes));
  return tiles;
}

Status SolidFiller::fall_back(const VoxelizePlan& plan, const Error& error,
                              std::vector<SparseTile>& tiles, VoxelizeStats& stats) {
  if (!may_fall_back(plan.options, error)) return error;
  record_fallback(error, stats);
  tiles.clear();
  return {};
}

Result<std::vector<SparseTile>> SolidFiller::find_signed(
    const VoxelizePlan& plan, const FillMesh& mesh, const TouchTiles& touch,
    const ColumnProgress& progress, const std::vector<SparseTile>& surface, VoxelizeStats& stats) {
  Stopwatch watch;
  FillStats& fill = stats.fill.emplace();
  const Choice choice = choose(plan, mesh, fill);
  add_stage(stats.passes, "sign", watch.lap());
  AxisVotes votes;
  const double before = total(stats.passes);
  VOXELD_ASSIGN(std::vector<SparseTile> found,
                inside(plan, mesh, touch, progress, surface, choice.sign, votes, stats));
  if (choice.sign == Sign::kMajority || choice.sign == Sign::kAuto) {
    fill.ambiguous_fraction =
        votes.inside == 0 ? 0.0
                          : static_cast<double>(votes.disagree) / static_cast<double>(votes.inside);
  } else if (choice.closed) {
    fill.ambiguous_fraction = 0.0;
  }
  // A device's passes are reported under their own names; "inside" is the rest.
  add_stage(stats.passes, "inside", std::max(0.0, watch.lap() - (total(stats.passes) - before)));
  if (!plan.channels.volume) return found;
  VOXELD_ASSIGN(coverage_,
                CoverageCounts::of(mesh, plan.spec.dims, choice.sign, finder_, progress));
  coverage_->spell_out(found);
  add_stage(stats.passes, "coverage", watch.lap());
  return found;
}

Status SolidFiller::unite(const VoxelizePlan& plan, const ColumnProgress& progress,
                          std::vector<SparseTile> found, std::vector<SparseTile>& tiles,
                          VoxelizeStats& stats) const {
  Stopwatch watch;
  const ChannelSet& channels = plan.channels.grid;
  const bool copies = plan.options.interior == Interior::kNearest && plan.channels.any();
  std::vector<SparseTile> surface;  // a copy without attributes
  if (copies) {
    VOXELD_TRY(check_host_bytes(plan.spec, interior_bytes(plan.spec, tiles, found, channels),
                                host_bytes_max_));
    for (const SparseTile& tile : tiles) {
      surface.push_back({tile.coord, tile.brick_morton, tile.masks, {}});
    }
    for (SparseTile& tile : found) spell_out_full(tile);
  }
  merge_tiles(std::move(found), channels, team_, tiles);
  add_stage(stats.passes, "merge", watch.lap());
  if (!copies) return {};
  VOXELD_TRY(copy_nearest(surface, plan.spec, team_, progress, tiles));
  add_stage(stats.passes, "interior", watch.lap());
  return {};
}

Status SolidFiller::fill(const VoxelizePlan& plan, const TouchTiles& touch,
                         const ColumnProgress& progress, std::vector<SparseTile>& tiles,
                         VoxelizeStats& stats) {
  const FillMesh mesh = FillMesh::of(plan.scene, plan.world_from_file, plan.spec, plan.mesh);
  const Fill kind = plan.options.fill;
  const bool measures = plan.channels.grid.distance;
  std::vector<SparseTile> found;
  if (measures || kind == Fill::kSolid || kind == Fill::kShell) {
    VOXELD_ASSIGN(found, find_signed(plan, mesh, touch, progress, tiles, stats));
  }
  Stopwatch watch;
  std::optional<DistanceMaker> distances;
  if (measures || kind == Fill::kBand) {
    distances.emplace(mesh, plan.spec.dims, measures ? found : std::vector<SparseTile>(), team_);
    add_stage(stats.passes, "tree", watch.lap());
  }
  if (kind == Fill::kBand) {
    VOXELD_ASSIGN(found, distances->band(plan.options.thickness, progress));
    if (!measures) std::ranges::for_each(found, canonicalize);
    add_stage(stats.passes, "band", watch.lap());
  }
  if (kind == Fill::kShell) {
    const std::vector<SparseTile>* surface = &tiles;
    TouchCells cells(plan, tiles);
    if (plan.options.rule == Rule::kNone) {
      VOXELD_ASSIGN(surface, cells.get(touch));
    }
    VOXELD_TRY(keep_shell(*surface, plan.options.thickness, team_, progress, found));
    add_stage(stats.passes, "shell", watch.lap());
  }
  // Makes room for distances. They are measured last, when all voxels exist.
  for (SparseTile& tile : tiles) resize_channels(tile, plan.channels.grid);
  if (kind != Fill::kSurface) {
    VOXELD_TRY(unite(plan, progress, std::move(found), tiles, stats));
  }
  if (coverage_) coverage_->write(tiles);
  if (!measures) return {};
  watch.lap();
  VOXELD_TRY(distances->measure(progress, tiles));
  add_stage(stats.passes, "distance", watch.lap());
  return {};
}

int64_t distance_bytes(const FillMesh& mesh, const GridSpec& spec, const VoxelizeOptions& options,
                       const WantedChannels& channels) {
  const bool is_band = options.fill == Fill::kBand;
  if (!is_band && !channels.grid.distance) return 0;
  const glm::ivec3 tiles = spec.tile_dims();
  // A tree, and tables of the inside bricks.
  const int64_t bytes = TriangleTree::bytes_for(static_cast<int64_t>(mesh.triangle_count())) +
                        int64_t{tiles.x} * tiles.y * tiles.z * (int64_t{8} << 15);
  if (!is_band) return bytes;
  const int64_t cells = band_cells_max(mesh, spec.dims, options.thickness);
  constexpr int64_t kCellsPerBrick =
      int64_t{limits::kBrickSide} * limits::kBrickSide * limits::kBrickSide;
  constexpr int64_t kBrickBytes = sizeof(BrickMask) + sizeof(uint32_t);
  const auto voxel_bytes = static_cast<int64_t>(attribute_bytes(channels.grid) + sizeof(int16_t));
  // Bricks and samples count twice, because they exist twice while surface and band are united.
  return bytes + 2 * (cells * voxel_bytes + (cells / kCellsPerBrick + 1) * kBrickBytes);
}

}  // namespace voxeld
