#include "server/voxel/solid/solid_filler.h"

#include <algorithm>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "proto/limits.h"
#include "proto/options/values.h"
#include "server/base/cancel_point.h"
#include "server/base/clock.h"
#include "server/base/pieces.h"
#include "server/voxel/pipelines/fallback.h"
#include "server/voxel/solid/auto_sign.h"
#include "server/voxel/solid/distance/distance_field.h"
#include "server/voxel/solid/distance/distance_maker.h"
#include "server/voxel/solid/flood.h"
#include "server/voxel/solid/inside/boundary.h"
#include "server/voxel/solid/inside/winding_field.h"
#include "server/voxel/solid/interior.h"
#include "server/voxel/solid/merge.h"
#include "server/voxel/solid/regions.h"
#include "server/voxel/solid/shell.h"

namespace voxeld {
namespace {

double total(const StageTimes& passes) {
  double ms = 0;
  for (const auto& pass : passes) ms += pass.second;
  return ms;
}

// Whether some cell is not surface.
bool has_cells_beside(const std::vector<SparseTile>& cells, const SurfaceTiles& surface) {
  for (const SparseTile& tile : cells) {
    cancel_point();
    const SparseTile* beside = surface.find({tile.coord[0], tile.coord[1], tile.coord[2]});
    if (tile.voxel_count() > 0 && beside == nullptr) return true;
    bool found = false;
    for_each_brick(tile, [&](uint32_t morton, const BrickMask& mask, size_t) {
      cancel_point();
      found = found || count_beside(mask, beside, morton) > 0;
    });
    if (found) return true;
  }
  return false;
}

// The number of triangles of closing_cones().
int64_t cone_count(const std::vector<BoundaryEdge>& boundary) {
  int64_t count = 0;
  for_each_in_pieces(std::span(boundary), [&](const BoundaryEdge& edge) { count += edge.count; });
  return count;
}

double share(int64_t part, int64_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

}  // namespace

// The cells of rule=touch: the surface itself if that is the plan's rule, else made on demand.
class SolidFiller::TouchCells {
 public:
  TouchCells(const VoxelizePlan& plan, const std::vector<SparseTile>& surface,
             const TouchTiles& make)
      : surface_(plan.options.rule == Rule::kTouch ? &surface : nullptr), make_(make) {}

  Result<const std::vector<SparseTile>*> get() {
    if (surface_ != nullptr) return surface_;
    if (!made_) {
      VOXELD_ASSIGN(made_, make_());
    }
    return &*made_;
  }

 private:
  const std::vector<SparseTile>* surface_;
  const TouchTiles& make_;
  std::optional<std::vector<SparseTile>> made_;
};

Result<Sign> SolidFiller::choose(const Work& work, FillStats& fill) const {
  fill.sign = work.plan.options.sign;
  fill.reason = "asked for";
  if (fill.sign != Sign::kAuto && fill.sign != Sign::kWinding) return fill.sign;
  const std::vector<BoundaryEdge> boundary = boundary_edges(work.mesh);
  fill.boundary_edges = static_cast<int64_t>(boundary.size());
  const bool closed = boundary.empty();
  if (closed) fill.ambiguous_fraction = 0.0;
  if (fill.sign == Sign::kWinding) {
    const VoxelizePlan& plan = work.plan;
    const int64_t bytes = mesh_bytes(plan.scene) + WindingField::bytes_for(cone_count(boundary));
    VOXELD_TRY(check_host_bytes(plan.spec, bytes, host_bytes_max_));
    return fill.sign;
  }
  if (!closed) return fill.sign;
  fill.sign = Sign::kNonzero;
  fill.reason = "nonzero: the mesh is closed and consistently oriented";
  return Sign::kNonzero;
}

Result<std::vector<SparseTile>> SolidFiller::inside(const Work& work, Sign sign,
                                                    bool keeps_doubtful, AxisVotes& votes) {
  const VoxelizePlan& plan = work.plan;
  std::vector<SparseTile> tiles;
  if (sign == Sign::kFlood) {
    VOXELD_ASSIGN(const auto* touched, work.touch.get());
    if (device_ != nullptr) {
      const auto done =
          device_->flood_inside(*touched, plan.spec.dims, work.progress, tiles, work.stats);
      if (done.ok() && *done) return tiles;
      if (!done) VOXELD_TRY(fall_back(plan, done.error(), tiles, work.stats));
    }
    VOXELD_TRY(flood_inside(*touched, plan.spec.dims, work.progress, tiles));
    return tiles;
  }
  const InsideJob job = {work.mesh, plan.spec.dims, sign, {work.surface}, keeps_doubtful};
  if (device_ != nullptr) {
    const Status found = device_->find_inside(job, work.progress, tiles, votes, work.stats);
    if (found) return tiles;
    VOXELD_TRY(fall_back(plan, found.error(), tiles, work.stats));
    votes = {};
  }
  VOXELD_TRY(finder_.find(job, work.progress, tiles, votes));
  return tiles;
}

Result<std::vector<SparseTile>> SolidFiller::inside_auto(const Work& work, FillStats& fill) {
  AxisVotes votes;
  VOXELD_ASSIGN(std::vector<SparseTile> found, inside(work, Sign::kMajority, true, votes));
  VOXELD_ASSIGN(const auto* touched, work.touch.get());
  // Surface cells of rule=touch are part of the grid, inside or not.
  const VoxelizePlan& plan = work.plan;
  const bool decides_touched =
      plan.options.rule != Rule::kTouch || plan.keeps_inside || plan.channels.grid.distance;
  AutoReport report;
  Stopwatch watch;
  VOXELD_TRY(settle_doubt(work.mesh, plan.spec.dims, {*touched, decides_touched}, team_,
                          work.progress, votes, found, report));
  add_stage(work.stats.passes, "doubt", watch.lap());
  fill.ambiguous_fraction = share(report.doubtful, votes.inside);
  const int64_t edges = *fill.boundary_edges;
  fill.sign = Sign::kMajority;
  fill.reason = "majority, one state for each closed region, and " +
                std::string(report.by_winding ? "winding" : "majority") +
                " where the axes disagree: the mesh does not close at " + std::to_string(edges) +
                (edges == 1 ? " edge" : " edges");
  return found;
}

Status SolidFiller::fall_back(const VoxelizePlan& plan, const Error& error,
                              std::vector<SparseTile>& tiles, VoxelizeStats& stats) {
  if (!may_fall_back(plan.options, error)) return error;
  record_fallback(error, stats);
  tiles.clear();
  return {};
}

Result<std::vector<SparseTile>> SolidFiller::find_signed(const Work& work) {
  Stopwatch watch;
  FillStats& fill = work.stats.fill.emplace();
  VOXELD_ASSIGN(const Sign sign, choose(work, fill));
  add_stage(work.stats.passes, "sign", watch.lap());
  const double before = total(work.stats.passes);
  std::vector<SparseTile> found;
  if (sign == Sign::kAuto) {
    VOXELD_ASSIGN(found, inside_auto(work, fill));
  } else {
    AxisVotes votes;
    VOXELD_ASSIGN(found, inside(work, sign, false, votes));
    if (sign == Sign::kMajority) fill.ambiguous_fraction = share(votes.disagree, votes.inside);
  }
  VOXELD_ASSIGN(fill.sign_with_inside, sign_with_inside(work, found));
  // A device's passes are reported under their own names; "inside" is the rest.
  add_stage(work.stats.passes, "inside",
            std::max(0.0, watch.lap() - (total(work.stats.passes) - before)));
  if (!work.plan.channels.volume) return found;
  const glm::ivec3& dims = work.plan.spec.dims;
  const bool settles = sign == Sign::kAuto;
  VOXELD_ASSIGN(coverage_, CoverageCounts::of(work.mesh, dims, settles ? Sign::kMajority : sign,
                                              finder_, work.progress));
  if (settles) {
    VOXELD_ASSIGN(const auto* touched, work.touch.get());
    coverage_->settle_untouched(*touched, found);
  }
  coverage_->spell_out(found);
  add_stage(work.stats.passes, "coverage", watch.lap());
  return found;
}

Result<std::optional<Sign>> SolidFiller::sign_with_inside(const Work& work,
                                                          const std::vector<SparseTile>& found) {
  const SurfaceTiles surface = {work.surface};
  if (has_cells_beside(found, surface)) return std::optional<Sign>();
  std::vector<SparseTile> others;
  AxisVotes votes;
  const auto go_on = [&](size_t) { return work.progress ? work.progress(0) : Status(); };
  VOXELD_TRY(finder_.find({work.mesh, work.plan.spec.dims, Sign::kMajority, surface}, go_on, others,
                          votes));
  if (has_cells_beside(others, surface)) return std::optional(Sign::kMajority);
  VOXELD_ASSIGN(const auto* touched, work.touch.get());
  Regions regions(*touched, work.plan.spec.dims);
  VOXELD_TRY(regions.flood_outside(go_on));
  return regions.next() ? std::optional(Sign::kFlood) : std::nullopt;
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
      cancel_point();
      surface.push_back({tile.coord, tile.brick_morton, tile.masks, {}});
    }
    for (SparseTile& tile : found) {
      cancel_point();
      spell_out_full(tile);
    }
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
  TouchCells touched(plan, tiles, touch);
  std::vector<SparseTile> found;
  if (measures || kind == Fill::kSolid || kind == Fill::kShell) {
    VOXELD_ASSIGN(found, find_signed({plan, mesh, tiles, touched, progress, stats}));
  }
  Stopwatch watch;
  std::optional<DistanceMaker> distances;
  if (measures || kind == Fill::kBand) {
    distances.emplace(mesh, plan.spec.dims, distance_scale(plan.spec, plan.options.distance),
                      measures ? found : std::vector<SparseTile>(), team_);
    add_stage(stats.passes, "tree", watch.lap());
  }
  if (kind == Fill::kBand) {
    VOXELD_ASSIGN(found, distances->band(plan.options.thickness, progress));
    for (SparseTile& tile : found) {
      cancel_point();
      if (!measures) canonicalize(tile);
    }
    add_stage(stats.passes, "band", watch.lap());
  }
  if (kind == Fill::kShell) {
    const std::vector<SparseTile>* surface = &tiles;
    if (plan.options.rule == Rule::kNone) {
      VOXELD_ASSIGN(surface, touched.get());
    }
    VOXELD_TRY(keep_shell(*surface, plan.options.thickness, team_, progress, found));
    add_stage(stats.passes, "shell", watch.lap());
  }
  if (plan.keeps_inside) keep_inside(found, tiles);
  // Makes room for distances. They are measured last, when all voxels exist.
  for (SparseTile& tile : tiles) {
    cancel_point();
    resize_channels(tile, plan.channels.grid);
  }
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

Status check_distance_unit(const GridSpec& spec, DistanceUnit unit) {
  const glm::dvec3 scale = distance_scale(spec, unit);
  const double aspect = std::max({scale.x, scale.y, scale.z});
  if (aspect <= limits::kDistanceAspectMax) return {};
  return Error{ErrorCode::kInvalidOption,
               "distance=world: the longest edge of a voxel, divided by the shortest",
               "at most " + std::to_string(limits::kDistanceAspectMax),
               option_values::to_text(aspect)};
}

int64_t tree_bytes(const VoxelizeOptions& options, int64_t triangles) {
  const bool needs_sign = options.has_inside() || options.measures();
  const bool winds = options.sign == Sign::kAuto || options.sign == Sign::kWinding;
  const bool measures = options.fill == Fill::kBand || options.measures();
  // The first is more than the lists take that find the boundary.
  return (needs_sign && winds ? WindingField::bytes_for(triangles) : 0) +
         (measures ? TriangleTree::bytes_for(triangles) : 0);
}

int64_t distance_bytes(const Scene& scene, const SnappedMesh& mesh, const Placed& placed,
                       const VoxelizeOptions& options, const WantedChannels& channels) {
  const bool is_band = options.fill == Fill::kBand;
  if (!is_band && !channels.grid.distance) return 0;
  const glm::ivec3 tiles = placed.spec.tile_dims();
  // Tables of the inside bricks.
  const int64_t bytes = int64_t{tiles.x} * tiles.y * tiles.z * (int64_t{8} << 15);
  if (!is_band) return bytes;
  const FillMesh fill = FillMesh::of(scene, placed.world_from_file, placed.spec, mesh);
  const int64_t cells = band_cells_max(fill, placed.spec.dims, options.thickness);
  constexpr int64_t kCellsPerBrick =
      int64_t{limits::kBrickSide} * limits::kBrickSide * limits::kBrickSide;
  constexpr int64_t kBrickBytes = sizeof(BrickMask) + sizeof(uint32_t);
  const auto voxel_bytes = static_cast<int64_t>(attribute_bytes(channels.grid) + sizeof(int16_t));
  // Bricks and samples count twice, because they exist twice while surface and band are united.
  return bytes + 2 * (cells * voxel_bytes + (cells / kCellsPerBrick + 1) * kBrickBytes);
}

}  // namespace voxeld
