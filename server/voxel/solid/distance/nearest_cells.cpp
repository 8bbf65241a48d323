#include "server/voxel/solid/distance/nearest_cells.h"

#include <algorithm>
#include <atomic>
#include <bit>

#include "server/base/cancel_point.h"
#include "server/voxel/solid/distance/brick_planes.h"

namespace voxeld {
namespace {

constexpr int kNowhere = -(1 << 20);  // no set cell to the left; negated: to the right
constexpr int kLinesAtOnce = 16;      // because neighbours along y share cache lines

// The cells of a brick at y, z; bit x is cell x.
uint32_t row_of(const BrickMask& mask, int y, int z) {
  const auto in_y = static_cast<size_t>(y & 7), in_z = static_cast<size_t>(z & 7);
  const size_t octant = (in_z & 4) | (in_y & 4) / 2;
  const int place = brick_layout::kPlaceY[in_y & 3] + brick_layout::kPlaceZ[in_z & 3];
  return static_cast<uint32_t>(brick_layout::gather_x(mask.words[octant] >> place) |
                               brick_layout::gather_x(mask.words[octant + 1] >> place) << 4);
}

}  // namespace

NearestCells::NearestCells(const BrickIndex& set, const glm::ivec3& dims, ThreadTeam& team)
    : dims_(dims), team_(team), brick_rows_((dims.y + kWidth - 1) / kWidth) {
  const glm::ivec3 bricks = (dims + kWidth - 1) / kWidth;
  rows_.resize(static_cast<size_t>(bricks.y) * static_cast<size_t>(bricks.z));
  for (int z = 0; z < bricks.z; ++z) {
    for (int y = 0; y < bricks.y; ++y) {
      cancel_point();
      for (int x = 0; x < bricks.x; ++x) {
        const BrickMask* mask = set.find({x, y, z});
        if (mask != nullptr) rows_[row_of_bricks(y * kWidth, z * kWidth)].push_back({x, mask});
      }
    }
  }
  scratch_.resize(static_cast<size_t>(team.threads()));
  const size_t cells = size_t{kWidth} * static_cast<size_t>(dims.y) * static_cast<size_t>(dims.z);
  squared_.resize(cells);
  for (auto* nearest : {&nearest_x_, &nearest_y_, &nearest_z_}) nearest->resize(cells);
}

// Finds, for each of the slab's cells, the nearest set cell of its row. Results go to the scratch.
bool NearestCells::run_row(int slab, int y, int z, Scratch& scratch) const {
  const std::vector<Brick>& row = rows_[row_of_bricks(y, z)];
  const auto here = std::ranges::lower_bound(row, slab, {}, &Brick::x);
  const bool has_own = here != row.end() && here->x == slab;
  const uint32_t own = has_own ? row_of(*here->mask, y, z) : 0;
  int left = kNowhere, right = -kNowhere;
  for (auto brick = here; brick != row.begin() && left == kNowhere;) {
    --brick;
    const uint32_t cells = row_of(*brick->mask, y, z);
    if (cells != 0) left = brick->x * kWidth + std::bit_width(cells) - 1;
  }
  for (auto brick = here + (has_own ? 1 : 0); brick != row.end() && right == -kNowhere; ++brick) {
    const uint32_t cells = row_of(*brick->mask, y, z);
    if (cells != 0) right = brick->x * kWidth + std::countr_zero(cells);
  }
  if (own == 0 && left == kNowhere && right == -kNowhere) return false;
  add_row(slab, y, {left, own, right}, scratch);
  return true;
}

void NearestCells::add_row(int slab, int y, const SetCells& set, Scratch& scratch) const {
  int left = set.left;
  for (int x = 0; x < kWidth; ++x) {
    const int cell = slab * kWidth + x;
    if ((set.own >> x & 1) != 0) left = cell;
    const uint32_t beyond = set.own >> x;
    const int next = beyond != 0 ? cell + std::countr_zero(beyond) : set.right;
    const int nearest = cell - left <= next - cell ? left : next;
    const auto apart = static_cast<uint32_t>(std::abs(cell - nearest));
    const size_t at =
        static_cast<size_t>(x) * static_cast<size_t>(dims_.y) + static_cast<size_t>(y);
    scratch.squared[at] = apart * apart;
    scratch.x[at] = static_cast<int16_t>(nearest);
  }
}

void NearestCells::run_plane(int slab, int z, Scratch& scratch) {
  cancel_point();
  const auto rows = static_cast<size_t>(dims_.y);
  scratch.squared.assign(size_t{kWidth} * rows, kNoDistance);
  scratch.x.resize(size_t{kWidth} * rows);
  bool any = false;
  for (int y = 0; y < dims_.y; ++y) {
    if (run_row(slab, y, z, scratch)) any = true;
  }
  for (int x = 0; x < kWidth; ++x) {
    const size_t out = place(x, 0, z), in = static_cast<size_t>(x) * rows;
    if (!any) {
      std::fill_n(squared_.begin() + static_cast<ptrdiff_t>(out), rows, kNoDistance);
      continue;
    }
    const LowerEnvelope& envelope = scratch.envelope;
    scratch.envelope.build(std::span(scratch.squared).subspan(in, rows));
    envelope.visit(0, static_cast<uint32_t>(rows), [&](uint32_t y, uint32_t nearest) {
      squared_[out + y] = envelope.value(nearest, y);
      nearest_x_[out + y] = scratch.x[in + nearest];
      nearest_y_[out + y] = static_cast<int16_t>(nearest);
    });
  }
}

void NearestCells::run_lines(int y_begin, int y_end, Scratch& scratch) {
  const auto planes = static_cast<size_t>(dims_.z);
  const auto count = static_cast<size_t>(y_end - y_begin);
  scratch.squared.resize(count * planes);
  for (int x = 0; x < kWidth; ++x) {
    cancel_point();
    for (size_t z = 0; z < planes; ++z) {
      const size_t from = place(x, y_begin, static_cast<int>(z));
      for (size_t i = 0; i < count; ++i) scratch.squared[i * planes + z] = squared_[from + i];
    }
    for (size_t i = 0; i < count; ++i) {
      scratch.envelope.build(std::span(scratch.squared).subspan(i * planes, planes));
      scratch.envelope.visit(0, static_cast<uint32_t>(planes), [&](uint32_t z, uint32_t nearest) {
        nearest_z_[place(x, y_begin + static_cast<int>(i), static_cast<int>(z))] =
            static_cast<int16_t>(nearest);
      });
    }
  }
}

bool NearestCells::compute(int slab) {
  if (std::ranges::all_of(rows_, [](const auto& row) { return row.empty(); })) return false;
  std::atomic<int> next_plane = 0;
  team_.run(team_.threads(), [&](int worker) {
    for (int z = next_plane++; z < dims_.z; z = next_plane++) {
      run_plane(slab, z, scratch_[static_cast<size_t>(worker)]);
    }
  });
  std::atomic<int> next_line = 0;
  team_.run(team_.threads(), [&](int worker) {
    for (int y = next_line.fetch_add(kLinesAtOnce); y < dims_.y;
         y = next_line.fetch_add(kLinesAtOnce)) {
      run_lines(y, std::min(y + kLinesAtOnce, dims_.y), scratch_[static_cast<size_t>(worker)]);
    }
  });
  return true;
}

}  // namespace voxeld
