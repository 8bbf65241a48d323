#include "server/voxel/solid/inside/column_maker.h"

#include <algorithm>
#include <bit>

#include "server/base/cancel_point.h"

namespace voxeld {
namespace {

// Bits of a row of bricks, seen as bytes: those of one brick are at brick_x, kRowBytes apart.
uint64_t brick_bits(const BrickRow& rows, int brick_x) {
  uint64_t bits = 0;
  for (size_t i = static_cast<size_t>(brick_x) / 8; i < kBrickRowWords; i += kBlockRowWords) {
    bits |= rows[i];
  }
  return bits >> (brick_x % 8 * 8) & 0xff;
}

int64_t count_bits(const BrickRow& rows) {
  int64_t count = 0;
  for (const uint64_t word : rows) count += std::popcount(word);
  return count;
}

bool is_whole(const TileExtent& extent) {
  return std::ranges::all_of(extent.size, [](int side) { return side == limits::kTileSide; });
}

}  // namespace

InsidePlan::InsidePlan(const InsideJob& inside_job, ThreadTeam& team)
    : job(inside_job), triangles(job.mesh, 2, job.dims) {
  if (needs_axes()) {
    along_x.emplace(job.mesh, 0, job.dims, team);
    along_y.emplace(job.mesh, 1, job.dims, team);
  }
  if (!needs_winding()) return;
  std::vector<glm::ivec3> corners = closing_cones(boundary_edges(job.mesh));
  if (corners.empty()) return;
  field.emplace(corners, job.mesh.sub_voxel_bits());
  cones = FillMesh::of(std::move(corners), job.mesh.sub_voxel_bits());
  of_cones.emplace(*cones, 2, job.dims);
}

void ColumnMaker::find_crossings(const InsidePlan& plan, size_t column,
                                 const ColumnWindow& window) {
  const int cells = plan.job.dims.z, tiles = plan.tiles_z();
  crossings_.clear();
  changes_.clear();
  append_crossings(plan.job.mesh, plan.triangles.triangles(column), 2, window, cells, crossings_);
  if (plan.job.sign == Sign::kNonzero) {
    column_winding_.set(crossings_, window);
    column_winding_.append_changes([](int winding) { return winding != 0; }, changes_);
    parity_crossings_.set(changes_, tiles);
    return;
  }
  if (plan.job.sign != Sign::kWinding) parity_crossings_.set(crossings_, tiles);
  if (!plan.needs_winding()) return;
  if (plan.cones) {
    append_crossings(*plan.cones, plan.of_cones->triangles(column), 2, window, cells, crossings_);
  }
  column_winding_.set(crossings_, window);
  column_winding_.append_changes([](int winding) { return winding > 0; }, changes_);
  winding_crossings_.set(changes_, tiles);
}

void ColumnMaker::begin_axes(const InsidePlan& plan, const glm::ivec3& tile) {
  const TileCrossings& x = plan.along_x->column(tile.y, tile.z);
  const TileCrossings& y = plan.along_y->column(tile.z, tile.x);
  surface_ = plan.job.surface.find(tile);
  axes_->x.begin_tile(x.below_tile(tile.x), x.of_tile(tile.x), tile.x * limits::kTileSide);
  axes_->y.begin_tile(y.below_tile(tile.y), y.of_tile(tile.y), tile.y * limits::kTileSide);
}

void ColumnMaker::run(const InsidePlan& plan, size_t column, const ColumnShare& share,
                      std::span<TileBits> tiles, std::vector<int>& whole, AxisVotes& votes) {
  window_ = plan.triangles.window(column);
  const glm::ivec3 corner(window_.u_first, window_.v_first, 0);
  const auto bricks_y = static_cast<size_t>((window_.v_count + 7) / limits::kBrickSide);
  TileExtent extent;
  extent.size = {window_.u_count, window_.v_count, 0};
  extent.brick_y_first = static_cast<int>(bricks_y * share.part / share.parts);
  extent.brick_y_end = static_cast<int>(bricks_y * (share.part + 1) / share.parts);
  const int v_offset = extent.brick_y_first * limits::kBrickSide;
  window_.v_first += v_offset;
  window_.v_count = std::min(extent.brick_y_end * limits::kBrickSide, window_.v_count) - v_offset;
  if (plan.needs_axes() && axes_ == nullptr) axes_ = std::make_unique<Axes>();
  if (plan.needs_winding() && winding_ == nullptr) winding_ = std::make_unique<SweepZ>();
  find_crossings(plan, column, window_);
  parity_.begin_column();
  if (winding_ != nullptr) winding_->begin_column();
  for (int z = 0; z < plan.tiles_z(); ++z) {
    cancel_point();
    const glm::ivec3 tile(corner.x / limits::kTileSide, corner.y / limits::kTileSide, z);
    const int base = z * limits::kTileSide;
    extent.size[2] = std::min(limits::kTileSide, plan.job.dims.z - base);
    bool untouched = !plan.needs_axes();
    if (plan.job.sign != Sign::kWinding) {
      parity_.toggle(parity_crossings_.of_tile(z), v_offset, base);
      untouched = untouched && parity_crossings_.of_tile(z).empty();
    }
    if (plan.needs_winding()) {
      winding_->toggle(winding_crossings_.of_tile(z), v_offset, base);
      untouched = untouched && winding_crossings_.of_tile(z).empty();
      thresholds_.begin_tile(plan.field ? &*plan.field : nullptr, tile * limits::kTileSide);
      untouched = untouched && !thresholds_.any();
    }
    const SweepZ& only = plan.job.sign == Sign::kWinding ? *winding_ : parity_;
    const int uniform = untouched ? only.uniform() : -1;
    if (uniform == 0) continue;
    if (uniform == 1 && is_whole(extent) && share.parts == 1) {
      whole[static_cast<size_t>(z)] = 1;
      continue;
    }
    if (plan.needs_axes()) begin_axes(plan, tile);
    make_tile(plan, tile, share, extent, tiles[static_cast<size_t>(z)], votes);
  }
}

void ColumnMaker::make_tile(const InsidePlan& plan, const glm::ivec3& tile,
                            const ColumnShare& share, const TileExtent& extent, TileBits& out,
                            AxisVotes& votes) {
  BrickRow rows;
  for (int z = 0; z < extent.bricks_z(); ++z) {
    for (int y = extent.brick_y_first; y < extent.brick_y_end; ++y) {
      cancel_point();
      if (plan.job.sign == Sign::kWinding) {
        winding_->next_row(y, z, rows);
        if (thresholds_.any()) apply_thresholds(plan, tile, y, z, rows);
      } else {
        parity_.next_row(y, z, rows);
      }
      if (plan.needs_axes()) vote(plan, tile, y, z, rows, votes);
      trim(extent, y, z, rows);
      out.add_row(share.part, y, z, rows);
    }
  }
  if (!doubtful_.empty()) keep_doubtful(tile, votes);
}

void ColumnMaker::keep_doubtful(const glm::ivec3& tile, AxisVotes& votes) {
  std::ranges::sort(doubtful_, {}, &std::pair<uint32_t, BrickMask>::first);
  SparseTile& kept = votes.doubtful.emplace_back();
  kept.coord = {tile.x, tile.y, tile.z};
  for (const auto& [morton, mask] : doubtful_) {
    kept.brick_morton.push_back(morton);
    kept.masks.push_back(mask);
  }
  canonicalize(kept);
  doubtful_.clear();
}

// Replaces `rows`, the parity along z, by the majority of the three axes.
void ColumnMaker::vote(const InsidePlan& plan, const glm::ivec3& tile, int brick_y, int brick_z,
                       BrickRow& rows, AxisVotes& votes) {
  BrickRow x, y, any, disagree;
  axes_->x.next_row(brick_y, brick_z, x);
  axes_->y.next_row(brick_y, brick_z, y);
  uint64_t some = 0;
  for (size_t i = 0; i < kBrickRowWords; ++i) {
    any[i] = rows[i] | x[i] | y[i];
    disagree[i] = any[i] & ~(rows[i] & x[i] & y[i]);
    rows[i] = (rows[i] & (x[i] | y[i])) | (x[i] & y[i]);
    some |= any[i];
  }
  if (some == 0) return;
  TileExtent extent;
  for (int axis = 0; axis < 3; ++axis) {
    extent.size[static_cast<size_t>(axis)] =
        std::min(limits::kTileSide, plan.job.dims[axis] - tile[axis] * limits::kTileSide);
  }
  trim(extent, brick_y, brick_z, any);
  trim(extent, brick_y, brick_z, disagree);
  votes.inside += count_bits(any);
  if (count_bits(disagree) == 0) return;
  for (int brick = 0; brick < kTileBricks; ++brick) {
    if (brick_bits(disagree, brick) == 0) continue;
    const uint32_t morton =
        morton_encode(static_cast<uint32_t>(brick), static_cast<uint32_t>(brick_y),
                      static_cast<uint32_t>(brick_z));
    const BrickMask cells = brick_of_row(disagree, brick);
    votes.disagree += count_beside(cells, surface_, morton);
    if (plan.job.keeps_doubtful) doubtful_.emplace_back(morton, cells);
  }
}

// Recomputes bricks whose threshold is not 1.
void ColumnMaker::apply_thresholds(const InsidePlan& plan, const glm::ivec3& tile, int brick_y,
                                   int brick_z, BrickRow& rows) {
  std::array<int, 512> cells;
  auto* bytes = reinterpret_cast<uint8_t*>(rows.data());
  const int v_offset = window_.v_first - tile.y * limits::kTileSide;
  const int bricks_x = (window_.u_count + 7) / limits::kBrickSide;
  for (int brick = 0; brick < bricks_x; ++brick) {
    const int one = thresholds_.of_brick(brick, brick_y, brick_z);
    if (one == 1) continue;
    if (one == Thresholds::kMixed) {
      thresholds_.of_cells(brick, brick_y, brick_z, cells);
    } else {
      cells.fill(one);
    }
    for (int i = 0; i < 64; ++i) {
      const int z = i / 8, y = i % 8, v = brick_y * limits::kBrickSide + y - v_offset;
      const int cell = tile.z * limits::kTileSide + brick_z * limits::kBrickSide + z;
      if (v >= window_.v_count || cell >= plan.job.dims.z) continue;
      uint32_t byte = 0;
      for (int x = 0; x < 8; ++x) {
        const int u = brick * limits::kBrickSide + x;
        if (u >= window_.u_count) break;
        const bool inside = column_winding_.at(u, v, cell) >=
                            cells[static_cast<size_t>(i) * 8 + static_cast<size_t>(x)];
        byte |= (inside ? 1u : 0u) << x;
      }
      bytes[static_cast<size_t>(i) * kRowBytes + static_cast<size_t>(brick)] =
          static_cast<uint8_t>(byte);
    }
  }
}

}  // namespace voxeld
