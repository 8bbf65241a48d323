#include "server/grid/morphology/cell_runs.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/grid/morphology/bit_box.h"

namespace voxeld {
namespace {

constexpr int kTileRow = limits::kTileSide;
constexpr size_t kTileRowCount = size_t{kTileRow} * kTileRow;

// Appends the runs of set bits of a row.
void append_runs(const uint64_t* words, std::vector<CellRun>& runs) {
  for (uint32_t w = 0; w < kTileRow / 64; ++w) {
    uint64_t rest = words[w];
    while (rest != 0) {
      const auto begin = static_cast<uint32_t>(std::countr_zero(rest));
      const auto length = static_cast<uint32_t>(std::countr_one(rest >> begin));
      const uint32_t end = begin + length;
      rest = end == 64 ? 0 : rest >> end << end;
      const auto from = static_cast<uint16_t>(64 * w + begin);
      const auto to = static_cast<uint16_t>(64 * w + end);
      if (begin == 0 && w > 0 && !runs.empty() && runs.back().end == from && words[w - 1] >> 63) {
        runs.back().end = to;
      } else {
        runs.push_back({from, to, 0});
      }
    }
  }
}

}  // namespace

uint32_t DisjointSets::add() {
  parents_.push_back(static_cast<uint32_t>(parents_.size()));
  return parents_.back();
}

void DisjointSets::add_all(size_t count) {
  for (size_t i = 0; i < count; ++i) add();
}

uint32_t DisjointSets::find(uint32_t member) {
  while (parents_[member] != member) {
    parents_[member] = parents_[parents_[member]];
    member = parents_[member];
  }
  return member;
}

void DisjointSets::unite(uint32_t a, uint32_t b) {
  a = find(a);
  b = find(b);
  parents_[std::max(a, b)] = std::min(a, b);
}

TileRuns::TileRuns(const SparseTile& tile) {
  const glm::ivec3 first = first_cell_of(tile.coord);
  BitBox bits({first, first + kTileRow});
  bits.mark(tile);
  row_firsts.reserve(kTileRowCount + 1);
  for (int z = first.z; z < first.z + kTileRow; ++z) {
    cancel_point();
    for (int y = first.y; y < first.y + kTileRow; ++y) {
      row_firsts.push_back(static_cast<uint32_t>(runs.size()));
      append_runs(bits.row(y, z), runs);
    }
  }
  row_firsts.push_back(static_cast<uint32_t>(runs.size()));
}

std::vector<ComponentSize> TileRuns::number_components(Neighbors neighbors) {
  DisjointSets sets;
  sets.add_all(runs.size());
  // The neighbours among the rows before.
  constexpr std::array<std::array<int, 2>, 4> kBefore = {{{-1, 0}, {0, -1}, {-1, -1}, {1, -1}}};
  for (size_t row = 0; row < kTileRowCount; ++row) {
    cancel_point();
    const auto y = static_cast<int>(row % kTileRow), z = static_cast<int>(row / kTileRow);
    for (const auto& [dy, dz] : kBefore) {
      const int slack = contact_slack(dy, dz, neighbors);
      if (slack < 0 || y + dy < 0 || y + dy >= kTileRow || z + dz < 0) continue;
      const auto other = static_cast<size_t>(z + dz) * kTileRow + static_cast<size_t>(y + dy);
      for_each_touch(runs, row_firsts[row], row_firsts[row + 1], runs, row_firsts[other],
                     row_firsts[other + 1], 0, slack,
                     [&](uint32_t i, uint32_t j) { sets.unite(i, j); });
    }
  }
  std::vector<ComponentSize> sizes;
  for (size_t row = 0; row < kTileRowCount; ++row) {
    cancel_point();
    for (uint32_t i = row_firsts[row]; i < row_firsts[row + 1]; ++i) {
      // The lowest run of a component comes first and numbers it.
      const uint32_t lowest = sets.find(i);
      if (lowest == i) {
        runs[i].component = static_cast<uint32_t>(sizes.size());
        sizes.push_back({0, static_cast<uint32_t>(row * kTileRow) + runs[i].begin});
      } else {
        runs[i].component = runs[lowest].component;
      }
      sizes[runs[i].component].voxels += static_cast<uint64_t>(runs[i].end - runs[i].begin);
    }
  }
  return sizes;
}

void TileRuns::keep_border() {
  std::vector<CellRun> kept;
  for (size_t row = 0; row < kTileRowCount; ++row) {
    cancel_point();
    const size_t y = row % kTileRow, z = row / kTileRow;
    const bool is_outer = y == 0 || y == kTileRow - 1 || z == 0 || z == kTileRow - 1;
    const uint32_t begin = row_firsts[row], end = row_firsts[row + 1];
    row_firsts[row] = static_cast<uint32_t>(kept.size());
    for (uint32_t i = begin; i < end; ++i) {
      if (is_outer || runs[i].begin == 0 || runs[i].end == kTileRow) kept.push_back(runs[i]);
    }
  }
  row_firsts.back() = static_cast<uint32_t>(kept.size());
  kept.shrink_to_fit();
  runs = std::move(kept);
}

}  // namespace voxeld
