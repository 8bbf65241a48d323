#include "server/voxel/solid/solid_filler.h"

#include <algorithm>
#include <string>
#include <utility>

#include "server/base/stopwatch.h"
#include "server/voxel/solid/boundary.h"
#include "server/voxel/solid/flood.h"
#include "server/voxel/solid/merge.h"
#include "server/voxel/solid/shell.h"

namespace voxeld {
namespace {

// The cells that rule=touch gives: the surface itself where that is the rule.
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
      VOXELD_ASSIGN(const bool done,
                    device_->flood_inside(*touched, plan.spec.dims, progress, tiles, stats));
      if (done) return tiles;
    }
    VOXELD_TRY(flood_inside(*touched, plan.spec.dims, progress, tiles));
    return tiles;
  }
  const InsideJob job = {mesh, plan.spec.dims, sign, {surface}};
  if (device_ != nullptr) {
    VOXELD_TRY(device_->find_inside(job, progress, tiles, votes, stats));
  } else {
    VOXELD_TRY(find_inside(job, pool_, progress, tiles, votes));
  }
  return tiles;
}

Status SolidFiller::fill(const VoxelizePlan& plan, const TouchTiles& touch,
                         const ColumnProgress& progress, std::vector<SparseTile>& tiles,
                         VoxelizeStats& stats) {
  Stopwatch watch;
  FillStats& fill = stats.fill.emplace();
  const FillMesh mesh = FillMesh::of(plan.scene, plan.world_from_file, plan.spec, plan.mesh);
  const Choice choice = choose(plan, mesh, fill);
  add_stage(stats.passes, "sign", watch.lap());
  AxisVotes votes;
  const double before = total(stats.passes);
  VOXELD_ASSIGN(std::vector<SparseTile> found,
                inside(plan, mesh, touch, progress, tiles, choice.sign, votes, stats));
  if (choice.sign == Sign::kMajority || choice.sign == Sign::kAuto) {
    fill.ambiguous_fraction =
        votes.inside == 0 ? 0.0
                          : static_cast<double>(votes.disagree) / static_cast<double>(votes.inside);
  } else if (choice.closed) {
    fill.ambiguous_fraction = 0.0;
  }
  // Passes of a device have names of their own; this is the rest.
  add_stage(stats.passes, "inside", std::max(0.0, watch.lap() - (total(stats.passes) - before)));
  if (plan.options.fill == Fill::kShell) {
    const std::vector<SparseTile>* surface = &tiles;
    TouchCells cells(plan, tiles);
    if (plan.options.rule == Rule::kNone) {
      VOXELD_ASSIGN(surface, cells.get(touch));
    }
    VOXELD_TRY(keep_shell(*surface, plan.options.thickness, pool_, progress, found));
    add_stage(stats.passes, "shell", watch.lap());
  }
  merge_tiles(std::move(found), {plan.channels.color, plan.channels.normal}, pool_, tiles);
  add_stage(stats.passes, "merge", watch.lap());
  return {};
}

}  // namespace voxeld
