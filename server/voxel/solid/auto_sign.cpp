#include "server/voxel/solid/auto_sign.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <iterator>
#include <optional>
#include <tuple>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/voxel/solid/inside/winding_field.h"
#include "server/voxel/solid/inside_cells.h"
#include "server/voxel/solid/regions.h"

namespace voxeld {
namespace {

// Cells inside of which the winding number is sampled. It decides if its size is above 1/2 at half
// of them.
constexpr size_t kSamplesMax = 256;
// A size below kLow or above kHigh at three cells of a group holds for all of them.
constexpr double kHalf = 0.5, kLow = 0.25, kHigh = 0.75;
// From this many radii on, triangles count as one dipole.
constexpr double kFarRadii = 3.0;
// Cells that are not in doubt, for each doubtful one that joins them, whose state it takes. One is
// enough where winding numbers mean nothing.
constexpr uint64_t kCertainMin = 7;
// A region of doubtful cells alone decides nothing up to this size.
constexpr uint64_t kPocketCellsMax = 512;
constexpr size_t kBricksPerProgress = 64;

BrickMask both(BrickMask a, const BrickMask& b) {
  for (size_t w = 0; w < 8; ++w) a.words[w] &= b.words[w];
  return a;
}

BrickMask either(BrickMask a, const BrickMask& b) {
  for (size_t w = 0; w < 8; ++w) a.words[w] |= b.words[w];
  return a;
}

BrickMask without(BrickMask a, const BrickMask& b) {
  for (size_t w = 0; w < 8; ++w) a.words[w] &= ~b.words[w];
  return a;
}

// The n-th cell of a mask in Morton order; n < count_of(mask).
uint32_t nth_cell(const BrickMask& mask, uint64_t n) {
  uint32_t w = 0;
  for (uint64_t count = 0; n >= (count = static_cast<uint64_t>(std::popcount(mask.words[w])));
       ++w) {
    n -= count;
  }
  uint64_t bits = mask.words[w];
  for (; n > 0; --n) bits &= bits - 1;
  return w * 64 + static_cast<uint32_t>(std::countr_zero(bits));
}

BrickMask one_cell(uint32_t cell) {
  BrickMask mask;
  mask.words[cell / 64] = uint64_t{1} << (cell % 64);
  return mask;
}

// Doubtful cells of a brick that no region decides: of regions that reach the outside, of pockets,
// and touched.
struct Doubt {
  size_t tile;
  uint32_t morton;
  BrickMask free, touched;
};

// In regions that reach the outside: they alone are flooded yet.
std::vector<Doubt> undecided(const Regions& regions, const std::vector<SparseTile>& doubtful,
                             bool decides_touched) {
  std::vector<Doubt> doubts;
  for (const SparseTile& tile : doubtful) {
    const size_t number = regions.tile_number({tile.coord[0], tile.coord[1], tile.coord[2]});
    for_each_brick(tile, [&](uint32_t morton, const BrickMask& cells, size_t) {
      cancel_point();
      Doubt doubt = {number, morton, {}, {}};
      doubt.free = both(cells, brick_of_planes(regions.reached(number, morton)));
      if (decides_touched) {
        doubt.touched = both(cells, brick_of_planes(regions.touched(number, morton)));
      }
      if (doubt.free != BrickMask{} || doubt.touched != BrickMask{}) doubts.push_back(doubt);
    });
  }
  return doubts;
}

// Gives all cells of a region that the outside does not reach the state of most of them. Adds
// those of which all are doubtful to `doubts`.
Status settle_enclosed(Regions& regions, std::vector<SparseTile>& doubtful,
                       const ColumnProgress& progress, std::vector<SparseTile>& inside,
                       std::vector<Doubt>& doubts) {
  InsideCells cells(inside, regions);
  const InsideCells in_doubt(doubtful, regions);
  while (const std::optional<Regions::Piece> start = regions.next()) {
    constexpr uint64_t kTileCells = uint64_t{1} << 24;
    static_assert(limits::kTileSide == 256);
    uint64_t count = 0, count_inside = 0, count_doubtful = 0;
    const Regions::Visit add = [&](const Regions::Piece& piece) {
      const size_t number = regions.tile_number(piece.tile);
      if (piece.brick == Regions::kWholeTile) {
        count += kTileCells;
        count_inside += cells.count(number);
        count_doubtful += in_doubt.count(number);
        return;
      }
      const BrickMask mask = brick_of_planes(piece.cells);
      count += count_of(mask);
      const auto morton = static_cast<uint32_t>(piece.brick);
      count_inside += count_of(both(mask, cells.brick(number, morton)));
      count_doubtful += count_of(both(mask, in_doubt.brick(number, morton)));
    };
    VOXELD_TRY(regions.flood(*start, Regions::Turn::kFirst, add, progress));
    if (count_doubtful == count && count <= kPocketCellsMax) {
      const Regions::Visit ask = [&](const Regions::Piece& piece) {
        doubts.push_back({regions.tile_number(piece.tile), static_cast<uint32_t>(piece.brick),
                          brick_of_planes(piece.cells), BrickMask{}});
      };
      VOXELD_TRY(regions.flood(*start, Regions::Turn::kSecond, ask, progress));
      continue;
    }
    if (count_inside == 0 || count_inside == count) continue;
    const bool is_inside = 2 * count_inside > count;
    const Regions::Visit settle = [&](const Regions::Piece& piece) {
      const size_t number = regions.tile_number(piece.tile);
      if (piece.brick == Regions::kWholeTile) {
        cells.change_tile(number, is_inside);
        return;
      }
      const auto morton = static_cast<uint32_t>(piece.brick);
      const BrickMask mask = brick_of_planes(piece.cells);
      const BrickMask now = both(mask, cells.brick(number, morton));
      if (now != (is_inside ? mask : BrickMask{})) cells.change(number, morton, mask, is_inside);
    };
    VOXELD_TRY(regions.flood(*start, Regions::Turn::kSecond, settle, progress));
  }
  cells.finish();
  return {};
}

// One doubt for each brick, in ascending order of tile and brick.
std::vector<Doubt> united(std::vector<Doubt> doubts) {
  const auto place = [](const Doubt& one) {
    cancel_point();
    return std::pair(one.tile, one.morton);
  };
  std::ranges::sort(doubts, {}, place);
  std::vector<Doubt> out;
  for (const Doubt& doubt : doubts) {
    if (out.empty() || place(out.back()) != place(doubt)) {
      out.push_back(doubt);
      continue;
    }
    out.back().free = either(out.back().free, doubt.free);
    out.back().touched = either(out.back().touched, doubt.touched);
  }
  return out;
}

// Decides about doubts: by their neighbours, by winding numbers, or by the majority, which stays.
class Verdicts {
 public:
  Verdicts(const FillMesh& mesh, const glm::ivec3& dims, const Regions& regions, ThreadTeam& team,
           const ColumnProgress& progress)
      : dims_(dims),
        regions_(regions),
        team_(team),
        progress_(progress),
        field_(corners_of(mesh), mesh.sub_voxel_bits(), kFarRadii) {}

  // Finds out whether the triangles are oriented well enough for winding numbers: by samples of the
  // cells inside.
  bool measure_orientation(std::vector<SparseTile>& inside) {
    const std::vector<glm::ivec3> samples = samples_of(inside);
    std::vector<uint8_t> is_high(samples.size());
    for_each(samples.size(), [&](size_t i) { is_high[i] = size_at(samples[i]) > kHalf ? 1 : 0; });
    const auto high = static_cast<size_t>(std::ranges::count(is_high, 1));
    by_winding_ = !samples.empty() && 2 * high >= samples.size();
    return by_winding_;
  }

  // Changes `inside` by the verdicts.
  Status decide(const std::vector<Doubt>& doubts, std::vector<SparseTile>& inside) const {
    InsideCells cells(inside, regions_);
    std::vector<BrickMask> verdicts(std::min(doubts.size(), kBricksPerProgress));
    for (size_t first = 0; first < doubts.size(); first += kBricksPerProgress) {
      const size_t count = std::min(kBricksPerProgress, doubts.size() - first);
      for_each(count, [&](size_t i) {
        const Doubt& doubt = doubts[first + i];
        verdicts[i] = verdict(doubt, cells.brick(doubt.tile, doubt.morton));
      });
      for (size_t i = 0; i < count; ++i) {
        const Doubt& doubt = doubts[first + i];
        const BrickMask asked = either(doubt.free, doubt.touched);
        cells.change(doubt.tile, doubt.morton, verdicts[i], true);
        cells.change(doubt.tile, doubt.morton, without(asked, verdicts[i]), false);
      }
      if (progress_) VOXELD_TRY(progress_(0));
    }
    cells.finish();
    return {};
  }

 private:
  static std::vector<glm::ivec3> corners_of(const FillMesh& mesh) {
    std::vector<glm::ivec3> corners;
    corners.reserve(3 * mesh.triangle_count());
    const auto is_below = [](const glm::ivec3& a, const glm::ivec3& b) {
      return std::tuple(a.x, a.y, a.z) < std::tuple(b.x, b.y, b.z);
    };
    for (size_t t = 0; t < mesh.triangle_count(); ++t) {
      cancel_point();
      // From the least on, so that sums do not depend on where a file's triangle begins.
      std::array<glm::ivec3, 3> of_triangle = mesh.corners(t);
      std::rotate(of_triangle.begin(), std::ranges::min_element(of_triangle, is_below),
                  of_triangle.end());
      std::ranges::copy(of_triangle, std::back_inserter(corners));
    }
    return corners;
  }

  template <typename Each>
  void for_each(size_t count, const Each& each) const {
    std::atomic<size_t> next = 0;
    team_.run(team_.threads(), [&](int) {
      for (size_t i = next++; i < count; i = next++) {
        cancel_point();
        each(i);
      }
    });
  }

  double size_at(const glm::ivec3& cell) const { return std::abs(field_.winding(cell)); }

  glm::ivec3 first_cell(size_t tile, uint32_t morton) const {
    const auto at = morton_decode(morton);
    return regions_.tile_at(tile) * limits::kTileSide +
           glm::ivec3(at[0], at[1], at[2]) * limits::kBrickSide;
  }
  static glm::ivec3 cell_at(const glm::ivec3& first, uint32_t cell) {
    const auto at = morton_decode(cell);
    return first + glm::ivec3(at[0], at[1], at[2]);
  }
  // The cells of a brick that are in the grid and not touched.
  BrickPlanes free_cells(const Doubt& doubt, const glm::ivec3& first) const {
    BrickPlanes free = regions_.touched(doubt.tile, doubt.morton);
    const glm::ivec3 left = glm::min(dims_ - first, glm::ivec3(limits::kBrickSide));
    uint64_t plane = 0;
    for (int y = 0; y < left.y; ++y) plane |= ((uint64_t{1} << left.x) - 1) << (8 * y);
    for (int z = 0; z < limits::kBrickSide; ++z) {
      uint64_t& word = free[static_cast<size_t>(z)];
      word = z < left.z ? ~word & plane : 0;
    }
    return free;
  }

  // At most kSamplesMax cells, evenly taken from the first ones of each brick or full node.
  std::vector<glm::ivec3> samples_of(std::vector<SparseTile>& inside) const {
    std::ranges::sort(inside, {}, &SparseTile::coord);
    std::vector<glm::ivec3> all;
    const auto add = [&](const SparseTile& tile, uint32_t morton, BrickMask mask) {
      cancel_point();
      const size_t number = regions_.tile_number({tile.coord[0], tile.coord[1], tile.coord[2]});
      mask = without(mask, brick_of_planes(regions_.touched(number, morton)));
      if (mask == BrickMask{}) return;
      all.push_back(cell_at(first_cell(number, morton), nth_cell(mask, 0)));
    };
    BrickMask whole;
    whole.words.fill(~uint64_t{0});
    for (const SparseTile& tile : inside) {
      for (size_t b = 0; b < tile.masks.size(); ++b) {
        add(tile, tile.brick_morton[b], tile.masks[b]);
      }
      for (const FullNode& node : tile.full) add(tile, node.brick_morton, whole);
    }
    if (all.size() <= kSamplesMax) return all;
    std::vector<glm::ivec3> samples;
    samples.reserve(kSamplesMax);
    for (size_t i = 0; i < kSamplesMax; ++i) samples.push_back(all[i * all.size() / kSamplesMax]);
    return samples;
  }

  // The cells of the doubt that are inside. majority: those of the brick.
  BrickMask verdict(const Doubt& doubt, const BrickMask& majority) const {
    const glm::ivec3 first = first_cell(doubt.tile, doubt.morton);
    BrickMask out = by_winding_ ? of_each(first, doubt.touched) : both(doubt.touched, majority);
    const BrickPlanes free = free_cells(doubt, first);
    for (BrickMask left = doubt.free; left != BrickMask{};) {
      BrickPlanes joined = planes_of_brick(one_cell(nth_cell(left, 0)));
      spread(free, joined);
      const BrickMask group = brick_of_planes(joined), asked = both(left, group);
      left = without(left, group);
      out = either(out, of_group(first, asked, without(group, doubt.free), majority));
    }
    return out;
  }

  // asked: the doubtful cells of a group, certain: its others.
  BrickMask of_group(const glm::ivec3& first, const BrickMask& asked, const BrickMask& certain,
                     const BrickMask& majority) const {
    const uint64_t count = count_of(certain), inside = count_of(both(certain, majority));
    const bool do_agree = count > 0 && (inside == 0 || inside == count);
    if (do_agree && count >= (by_winding_ ? kCertainMin : 1) * count_of(asked)) {
      return inside > 0 ? asked : BrickMask{};
    }
    return by_winding_ ? by_samples(first, asked) : both(asked, majority);
  }

  BrickMask by_samples(const glm::ivec3& first, const BrickMask& cells) const {
    const uint64_t count = count_of(cells);
    int high = 0, low = 0;
    for (const uint64_t n : {uint64_t{0}, count / 2, count - 1}) {
      const double size = size_at(cell_at(first, nth_cell(cells, n)));
      high += size > kHigh ? 1 : 0;
      low += size < kLow ? 1 : 0;
      if ((high > 0) == (low > 0)) return of_each(first, cells);  // they differ, or it is close
    }
    if (high == 3) return cells;
    return low == 3 ? BrickMask{} : of_each(first, cells);
  }

  BrickMask of_each(const glm::ivec3& first, const BrickMask& cells) const {
    BrickMask out;
    for (uint64_t n = 0, count = count_of(cells); n < count; ++n) {
      cancel_point();
      const uint32_t cell = nth_cell(cells, n);
      if (size_at(cell_at(first, cell)) > kHalf) out = either(out, one_cell(cell));
    }
    return out;
  }

  glm::ivec3 dims_;
  const Regions& regions_;
  ThreadTeam& team_;
  const ColumnProgress& progress_;
  WindingField field_;
  bool by_winding_ = false;
};

}  // namespace

Status settle_doubt(const FillMesh& mesh, const glm::ivec3& dims, const AutoSettings& settings,
                    ThreadTeam& team, const ColumnProgress& progress, AxisVotes& votes,
                    std::vector<SparseTile>& inside, AutoReport& report) {
  Regions regions(settings.touched, dims);
  VOXELD_TRY(regions.flood_outside(progress));
  std::vector<SparseTile> doubtful = std::exchange(votes.doubtful, {});
  std::vector<Doubt> doubts = undecided(regions, doubtful, settings.decides_touched);
  VOXELD_TRY(settle_enclosed(regions, doubtful, progress, inside, doubts));
  doubts = united(std::move(doubts));
  for (const Doubt& doubt : doubts) {
    cancel_point();
    report.doubtful += static_cast<int64_t>(count_of(doubt.free));
  }
  if (doubts.empty()) return {};
  Verdicts verdicts(mesh, dims, regions, team, progress);
  if (progress) VOXELD_TRY(progress(0));
  report.by_winding = verdicts.measure_orientation(inside);
  return verdicts.decide(doubts, inside);
}

int64_t auto_sign_bytes(const glm::ivec3& dims, int64_t surface_bytes) {
  constexpr int64_t kBrickBytes = sizeof(BrickMask) + sizeof(uint32_t);
  constexpr int64_t kDoubtBytes = 2 * (sizeof(Doubt) + 2 * sizeof(BrickMask));
  return Regions::bytes_for(dims, surface_bytes) + surface_bytes / kBrickBytes * kDoubtBytes;
}

}  // namespace voxeld
