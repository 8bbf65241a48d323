#include "server/voxel/gl/solid/gl_inside.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "server/base/clock.h"
#include "server/voxel/solid/inside/boundary.h"
#include "server/voxel/tiles/compact.h"
#include "server/voxel/tiles/tile_mask.h"

namespace voxeld {
namespace {

constexpr int kSlabs = limits::kTileSide / SOLID_SLAB_CELLS;  // slabs of a tile
constexpr int kSlabBricksHigh = SOLID_SLAB_CELLS / limits::kBrickSide;
constexpr uint32_t kBlockLevel = 3;  // the level of a full node of 64^3 cells
constexpr uint32_t kSome = 1, kSomeNot = 2;

bool is_set(uint32_t flags, uint32_t flag) {
  return (flags & flag) != 0;
}

// Slots that store the state below a tile while other columns are swept.
size_t x_slot(const glm::ivec3& tile_dims, const glm::ivec3& tile) {
  return static_cast<size_t>(tile.y) * static_cast<size_t>(tile_dims.z) +
         static_cast<size_t>(tile.z);
}
size_t y_slot(const glm::ivec3& tile) {
  return static_cast<size_t>(tile.z);
}

}  // namespace

bool GlInside::Place::is_whole() const {
  return cells == glm::ivec3(limits::kTileSide);
}

struct GlInside::Job {
  Job(const InsideJob& inside, std::vector<SparseTile>& found, AxisVotes& of_axes)
      : in(inside),
        tile_dims((inside.dims + limits::kTileSide - 1) / limits::kTileSide),
        sweeps(sweeps_of(inside.sign, tile_dims)),
        tiles(found),
        votes(of_axes) {
    for (int axis = 0; axis < 3; ++axis) {
      if (sweeps.carry_slots[static_cast<size_t>(axis)] == 0) continue;
      parity[static_cast<size_t>(axis)].emplace(in.mesh, axis, in.dims, limits::kTileSide);
    }
    if (!sweeps.counts) return;
    counts.emplace(in.mesh, 2, in.dims, SOLID_SLAB_CELLS);
    if (in.sign == Sign::kNonzero) return;
    std::vector<glm::ivec3> corners = closing_cones(boundary_edges(in.mesh));
    if (corners.empty()) return;
    field.emplace(corners, in.mesh.sub_voxel_bits());
    cones = FillMesh::of(std::move(corners), in.mesh.sub_voxel_bits());
    cone_counts.emplace(cones, 2, in.dims, SOLID_SLAB_CELLS);
  }

  const InsideJob& in;
  glm::ivec3 tile_dims;
  SolidSweeps sweeps;
  std::array<std::optional<SweepBins>, 3> parity;  // by axis
  std::optional<SweepBins> counts, cone_counts;    // binned by slabs
  FillMesh cones;
  std::optional<WindingField> field;  // set if the mesh is open
  std::vector<SparseTile>& tiles;
  AxisVotes& votes;
  StageTimes host;  // passes that run on the CPU
};

GlInside::GlInside(const gpu::Context& context, gpu::ShaderLibrary& shaders)
    : context_(&context), passes_(context, shaders) {}

int64_t GlInside::bytes_max(const glm::ivec3& dims, Sign sign) {
  const glm::ivec3 tiles = (dims + limits::kTileSide - 1) / limits::kTileSide;
  return SolidPasses::bytes_max(sweeps_of(sign, tiles));
}

Status GlInside::run(const InsideJob& in, const ColumnProgress& progress, int64_t other_bytes,
                     std::vector<SparseTile>& tiles, AxisVotes& votes, VoxelizeStats& stats) {
  mask_.resize(kTileMaskWords);
  flags_.resize(SOLID_FLAG_COUNT);
  carries_.resize(SOLID_CARRY_WORDS);
  Stopwatch watch;
  Job job(in, tiles, votes);
  add_stage(job.host, "inside_bin", watch.lap());
  // A cancelled job leaves by an exception.
  struct JobEnd {
    ~JobEnd() {
      inside.passes_.end_job();
      inside.timer_.reset();
    }
    GlInside& inside;
  };
  const JobEnd end{*this};
  timer_.emplace(*context_);
  Status done = passes_.begin_job(job.sweeps, stats.pipeline);
  if (done.ok()) done = run_job(job, progress);
  stats.device_bytes_peak = std::max(stats.device_bytes_peak, other_bytes + passes_.bytes());
  if (done.ok()) {
    for (const auto& [pass, ms] : timer_->results()) add_stage(stats.passes, pass, ms);
    for (const auto& [pass, ms] : job.host) add_stage(stats.passes, pass, ms);
  }
  return done;
}

// Runs the columns one after the other, so that only one column's sums below are stored. State that
// goes along x and y is stored in slots.
Status GlInside::run_job(Job& job, const ColumnProgress& progress) {
  size_t columns = 0;
  Place place;
  glm::ivec3& tile = place.tile;
  for (tile.x = 0; tile.x < job.tile_dims.x; ++tile.x) {
    for (tile.y = 0; tile.y < job.tile_dims.y; ++tile.y) {
      if (job.sweeps.carry_slots[2] > 0) passes_.clear_carries(2, 0);
      if (job.sweeps.counts) passes_.clear_count_carries();
      for (tile.z = 0; tile.z < job.tile_dims.z; ++tile.z) {
        if (job.sweeps.votes() && tile.y == 0) {
          passes_.clear_carries(1, static_cast<size_t>(tile.z));
        }
        place.cells = glm::min(job.in.dims - place.first(), glm::ivec3(limits::kTileSide));
        VOXELD_TRY(run_tile(job, place));
      }
      if (progress) VOXELD_TRY(progress(++columns));
    }
  }
  return {};
}

Status GlInside::run_tile(Job& job, const Place& place) {
  const bool counts = job.sweeps.counts, votes = job.sweeps.votes();
  if (counts) thresholds_.begin_tile(job.field ? &*job.field : nullptr, place.first());
  if (!is_touched(job, place) && !(counts && thresholds_.any())) {
    const std::optional<int> state = uniform_state(job, place);
    if (state == 0) return {};
    if (state == 1 && place.is_whole()) {
      SparseTile tile;
      tile.coord = {place.tile.x, place.tile.y, place.tile.z};
      tile.full.push_back({0, kTileLevels});
      job.tiles.push_back(std::move(tile));
      if (votes) job.votes.inside += int64_t{1} << 24;
      return {};
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (job.sweeps.carry_slots[static_cast<size_t>(axis)] == 0) continue;
    VOXELD_TRY(sweep_parity(job, place, axis));
  }
  if (!votes) {
    if (counts) VOXELD_TRY(sweep_counts(job, place));
    {
      const gpu::PassTimer::Pass pass = timer_->measure("inside_cells");
      VOXELD_TRY(passes_.make_cells(counts ? CellsOf::kCounts : CellsOf::kParity, place.cells));
    }
    take_tile(job, place);
    return {};
  }
  return vote(job, place);
}

Status GlInside::vote(Job& job, const Place& place) {
  {
    const gpu::PassTimer::Pass pass = timer_->measure("inside_cells");
    VOXELD_TRY(passes_.make_cells(CellsOf::kVote, place.cells));
  }
  count_votes(job, place);
  take_tile(job, place);
  return {};
}

bool GlInside::is_touched(const Job& job, const Place& place) const {
  for (int axis = 0; axis < 3; ++axis) {
    const auto& bins = job.parity[static_cast<size_t>(axis)];
    const SweepAxes axes = sweep_axes(axis);
    if (!bins) continue;
    if (!bins->triangles(place.tile[axes.u], place.tile[axes.v], place.tile[axis]).empty()) {
      return true;
    }
  }
  for (const auto* bins : {&job.counts, &job.cone_counts}) {
    if (!*bins) continue;
    const int end = std::min((place.tile.z + 1) * kSlabs, (*bins)->slabs());
    for (int slab = place.tile.z * kSlabs; slab < end; ++slab) {
      if (!(*bins)->triangles(place.tile.x, place.tile.y, slab).empty()) return true;
    }
  }
  return false;
}

std::optional<int> GlInside::uniform_parity(int axis, size_t slot) {
  passes_.read_carries(axis, slot, carries_);
  const uint32_t first = carries_.front();
  if (first != 0 && first != ~0u) return std::nullopt;
  if (!std::ranges::all_of(carries_, [&](uint32_t word) { return word == first; })) {
    return std::nullopt;
  }
  return first == 0 ? 0 : 1;
}

std::optional<int> GlInside::uniform_counts(Sign sign) {
  sums_.resize(SOLID_TILE_COLUMNS);
  passes_.read_count_carries(sums_);
  const auto inside = [&](int32_t sum) { return sign == Sign::kNonzero ? sum != 0 : sum >= 1; };
  const bool first = inside(sums_.front());
  if (!std::ranges::all_of(sums_, [&](int32_t sum) { return inside(sum) == first; })) {
    return std::nullopt;
  }
  return first ? 1 : 0;
}

std::optional<int> GlInside::uniform_state(const Job& job, const Place& place) {
  if (job.in.sign == Sign::kParity) return uniform_parity(2, 0);
  if (!job.sweeps.votes()) return uniform_counts(job.in.sign);
  const std::optional<int> z = uniform_parity(2, 0);
  if (!z || uniform_parity(1, y_slot(place.tile)) != z) return std::nullopt;
  if (uniform_parity(0, x_slot(job.tile_dims, place.tile)) != z) return std::nullopt;
  return z;
}

SweepTarget GlInside::target_of(const Place& place, int axis) const {
  const SweepAxes axes = sweep_axes(axis);
  const glm::ivec3 first = place.first();
  SweepTarget target;
  target.axis = axis;
  target.window = {first[axes.u], first[axes.v], place.cells[axes.u], place.cells[axes.v]};
  target.tile_first = target.cell_first = first[axis];
  target.cell_end = first[axis] + place.cells[axis];
  if (!context_->info().is_software) target.block_columns = kHardwareBlockColumns;
  return target;
}

Status GlInside::sweep_parity(Job& job, const Place& place, int axis) {
  const SweepAxes axes = sweep_axes(axis);
  const SweepTarget target = target_of(place, axis);
  const auto list = job.parity[static_cast<size_t>(axis)]->triangles(
      place.tile[axes.u], place.tile[axes.v], place.tile[axis]);
  VOXELD_TRY(passes_.begin_parity(axis));
  for (size_t next = 0; next < list.size();) {
    Stopwatch watch;
    next = fill_sweep_window(job.in.mesh, list, next, target, window_);
    add_stage(job.host, "inside_items", watch.lap());
    const gpu::PassTimer::Pass pass = timer_->measure("inside_crossings");
    VOXELD_TRY(passes_.mark_parity(window_, target));
  }
  const size_t slot = axis == 0   ? x_slot(job.tile_dims, place.tile)
                      : axis == 1 ? y_slot(place.tile)
                                  : 0;
  {
    const gpu::PassTimer::Pass pass = timer_->measure("inside_sweep");
    VOXELD_TRY(passes_.scan_parity(axis, slot));
  }
  return {};
}

Status GlInside::sweep_counts(Job& job, const Place& place) {
  SweepTarget target = target_of(place, 2);
  const int end = target.cell_end;
  for (int slab = 0; slab * SOLID_SLAB_CELLS < place.cells.z; ++slab) {
    target.cell_first = target.tile_first + slab * SOLID_SLAB_CELLS;
    target.cell_end = std::min(target.cell_first + SOLID_SLAB_CELLS, end);
    passes_.begin_counts(slab);
    VOXELD_TRY(mark_slab(job, *job.counts, job.in.mesh, target));
    if (job.cone_counts) VOXELD_TRY(mark_slab(job, *job.cone_counts, job.cones, target));
    slab_thresholds_.clear();
    if (thresholds_.any()) slab_thresholds(job, place, slab);
    const gpu::PassTimer::Pass pass = timer_->measure("inside_sweep");
    VOXELD_TRY(passes_.scan_counts(slab, job.in.sign, slab_thresholds_));
  }
  return {};
}

Status GlInside::mark_slab(Job& job, const SweepBins& bins, const FillMesh& mesh,
                           const SweepTarget& target) {
  const auto list = bins.triangles(target.window.u_first / limits::kTileSide,
                                   target.window.v_first / limits::kTileSide,
                                   target.cell_first / SOLID_SLAB_CELLS);
  for (size_t next = 0; next < list.size();) {
    Stopwatch watch;
    next = fill_sweep_window(mesh, list, next, target, window_);
    add_stage(job.host, "inside_items", watch.lap());
    const gpu::PassTimer::Pass pass = timer_->measure("inside_crossings");
    VOXELD_TRY(passes_.mark_counts(window_, target));
  }
  return {};
}

// Thresholds of the slab's bricks; layout in shaders/shared/solid.h.
void GlInside::slab_thresholds(Job& job, const Place& place, int slab) {
  Stopwatch watch;
  slab_thresholds_.assign(SOLID_SLAB_BRICKS, 1);
  const glm::ivec3 bricks = (place.cells + limits::kBrickSide - 1) / limits::kBrickSide;
  const int first = slab * kSlabBricksHigh, end = std::min(first + kSlabBricksHigh, bricks.z);
  std::array<int, 512> cells;
  for (int z = first; z < end; ++z) {
    for (int y = 0; y < bricks.y; ++y) {
      for (int x = 0; x < bricks.x; ++x) {
        const int one = thresholds_.of_brick(x, y, z);
        const int at = ((z - first) * kTileBricks + y) * kTileBricks + x;
        slab_thresholds_[static_cast<size_t>(at)] = one;
        if (one != Thresholds::kMixed) continue;
        const size_t mixed = (slab_thresholds_.size() - SOLID_SLAB_BRICKS) / cells.size();
        slab_thresholds_[static_cast<size_t>(at)] = SOLID_MIXED + static_cast<int>(mixed);
        thresholds_.of_cells(x, y, z, cells);
        slab_thresholds_.insert(slab_thresholds_.end(), cells.begin(), cells.end());
      }
    }
  }
  add_stage(job.host, "inside_thresholds", watch.lap());
}

// Adds up the votes, and reads the bricks on which the axes disagree.
void GlInside::count_votes(Job& job, const Place& place) {
  Stopwatch watch;
  passes_.read_flags(flags_);
  uint64_t blocks = 0;
  for (size_t block = 0; block < 64; ++block) {
    job.votes.inside += flags_[SOLID_FLAG_INSIDE + block];
    if (is_set(flags_[SOLID_FLAG_DISAGREE + block], kSome)) blocks |= uint64_t{1} << block;
  }
  if (blocks != 0) {
    SparseTile doubtful;
    doubtful.coord = {place.tile.x, place.tile.y, place.tile.z};
    passes_.read_disagreement(blocks, mask_);
    compact_mask(mask_, blocks, doubtful, {});
    const SparseTile* surface = job.in.surface.find(place.tile);
    for (size_t b = 0; b < doubtful.masks.size(); ++b) {
      job.votes.disagree += count_beside(doubtful.masks[b], surface, doubtful.brick_morton[b]);
    }
    if (job.in.keeps_doubtful && !doubtful.empty()) {
      canonicalize(doubtful);
      job.votes.doubtful.push_back(std::move(doubtful));
    }
  }
  add_stage(job.host, "inside_read", watch.lap());
}

void GlInside::take_tile(Job& job, const Place& place) {
  Stopwatch watch;
  passes_.read_flags(flags_);
  SparseTile tile;
  tile.coord = {place.tile.x, place.tile.y, place.tile.z};
  uint64_t mixed = 0;
  for (uint32_t block = 0; block < 64; ++block) {
    const uint32_t flags = flags_[SOLID_FLAG_CELLS + block];
    if (!is_set(flags, kSome)) continue;
    if (is_set(flags, kSomeNot)) {
      mixed |= uint64_t{1} << block;
    } else {
      tile.full.push_back({block << (3 * kBlockLevel), kBlockLevel});
    }
  }
  passes_.read_cells(mixed, mask_);
  add_stage(job.host, "inside_read", watch.lap());
  compact_mask(mask_, mixed, tile, {});
  canonicalize(tile);
  if (!tile.empty()) job.tiles.push_back(std::move(tile));
  add_stage(job.host, "inside_compact", watch.lap());
}

}  // namespace voxeld
