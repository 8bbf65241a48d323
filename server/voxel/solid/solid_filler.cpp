#include "server/voxel/solid/solid_filler.h"

#include <algorithm>
#include <string>
#include <utility>

#include "server/base/stopwatch.h"
#include "server/voxel/solid/boundary.h"
#include "server/voxel/solid/distance_field.h"
#include "server/voxel/solid/flood.h"
#include "server/voxel/solid/interior.h"
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

Status SolidFiller::unite(const VoxelizePlan& plan, const ColumnProgress& progress,
                          std::vector<SparseTile> found, std::vector<SparseTile>& tiles,
                          VoxelizeStats& stats) const {
  Stopwatch watch;
  const ChannelSet& channels = plan.channels.grid;
  const bool copies = plan.options.interior == Interior::kNearest && plan.channels.any();
  std::vector<SparseTile> surface;  // without attributes
  if (copies) {
    VOXELD_TRY(check_host_bytes(plan.spec, interior_bytes(plan.spec, tiles, found, channels),
                                host_bytes_max_));
    for (const SparseTile& tile : tiles) {
      surface.push_back({tile.coord, tile.brick_morton, tile.masks, {}});
    }
    for (SparseTile& tile : found) spell_out_full(tile);
  }
  merge_tiles(std::move(found), channels, pool_, tiles);
  add_stage(stats.passes, "merge", watch.lap());
  if (!copies) return {};
  VOXELD_TRY(copy_nearest(surface, plan.spec, pool_, progress, tiles));
  add_stage(stats.passes, "interior", watch.lap());
  return {};
}

Status SolidFiller::band(const VoxelizePlan& plan, const FillMesh& mesh,
                         const ColumnProgress& progress, std::vector<SparseTile>& tiles,
                         VoxelizeStats& stats) const {
  Stopwatch watch;
  const TriangleTree triangles(mesh);
  add_stage(stats.passes, "tree", watch.lap());
  const BrickIndex inside({}, plan.spec.dims);
  std::vector<DistanceTile> found;
  VOXELD_TRY(find_band({triangles, plan.spec.dims, inside}, plan.options.thickness, pool_, progress,
                       found));
  add_stage(stats.passes, "band", watch.lap());
  std::vector<SparseTile> cells;
  for (DistanceTile& tile : found) {
    canonicalize(tile.tile);
    cells.push_back(std::move(tile.tile));
  }
  return unite(plan, progress, std::move(cells), tiles, stats);
}

Status SolidFiller::fill(const VoxelizePlan& plan, const TouchTiles& touch,
                         const ColumnProgress& progress, std::vector<SparseTile>& tiles,
                         VoxelizeStats& stats) {
  Stopwatch watch;
  const FillMesh mesh = FillMesh::of(plan.scene, plan.world_from_file, plan.spec, plan.mesh);
  if (plan.options.fill == Fill::kBand) return band(plan, mesh, progress, tiles, stats);
  FillStats& fill = stats.fill.emplace();
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
  return unite(plan, progress, std::move(found), tiles, stats);
}

int64_t band_bytes(const FillMesh& mesh, const GridSpec& spec, double thickness,
                   const WantedChannels& channels) {
  const int64_t cells = band_cells_max(mesh, spec.dims, thickness);
  constexpr int64_t kBrickCells =
      int64_t{limits::kBrickSide} * limits::kBrickSide * limits::kBrickSide;
  constexpr int64_t kBrickBytes = sizeof(BrickMask) + sizeof(uint32_t);
  const int64_t voxel_bytes =
      static_cast<int64_t>(attribute_bytes(channels.grid)) + int64_t{sizeof(int16_t)};
  // Bricks and samples stand twice while surface and band are united.
  return 2 * (cells * voxel_bytes + (cells / kBrickCells + 1) * kBrickBytes) +
         TriangleTree::bytes_for(static_cast<int64_t>(mesh.triangle_count()));
}

}  // namespace voxeld
