// Runs of occupied cells along x in a tile, and the components that they form.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "proto/limits.h"
#include "proto/options/options.h"

namespace voxeld {

// Sets of numbers [0, size) that are united; each is named by its lowest number.
class DisjointSets {
 public:
  uint32_t add();
  void add_all(size_t count);
  uint32_t find(uint32_t member);
  void unite(uint32_t a, uint32_t b);
  size_t size() const { return parents_.size(); }

 private:
  std::vector<uint32_t> parents_;
};

// Cells [begin, end) of a row, in cells of the tile.
struct CellRun {
  uint16_t begin, end;
  uint32_t component;  // by order of first cells, by z, y, x
};

struct ComponentSize {
  uint64_t voxels = 0;
  uint32_t first_cell = UINT32_MAX;  // (z * 256 + y) * 256 + x, in the tile
};

// The runs of a tile by rows z, y, and then x.
struct TileRuns {
  explicit TileRuns(const SparseTile& tile);
  // Numbers the components of the tile by itself and returns their sizes.
  std::vector<ComponentSize> number_components(Neighbors neighbors);
  // Removes the runs that touch no face of the tile.
  void keep_border();

  std::vector<uint32_t> row_firsts;  // of each of the rows, and the end
  std::vector<CellRun> runs;
};

// Cells by which the ends of runs in rows dy and dz apart may miss each other and still touch; -1
// if they never do.
constexpr int contact_slack(int dy, int dz, Neighbors neighbors) {
  const int rows = (dy != 0 ? 1 : 0) + (dz != 0 ? 1 : 0);
  const int reach = neighbors == Neighbors::kFaces ? 1 : neighbors == Neighbors::kEdges ? 2 : 3;
  return rows > reach ? -1 : rows == reach ? 0 : 1;
}

// Calls unite(i, j) for the runs i of [a, a_end) and j of [b, b_end) that touch, where those of b
// are shifted by `shift` cells.
template <typename Unite>
void for_each_touch(const std::vector<CellRun>& a_runs, uint32_t a, uint32_t a_end,
                    const std::vector<CellRun>& b_runs, uint32_t b, uint32_t b_end, int shift,
                    int slack, Unite&& unite) {
  while (a < a_end && b < b_end) {
    const int a_from = a_runs[a].begin, a_to = a_runs[a].end;
    const int b_from = b_runs[b].begin + shift, b_to = b_runs[b].end + shift;
    if (a_from < b_to + slack && b_from < a_to + slack) unite(a, b);
    // The run that ends first touches nothing behind the other's end.
    if (a_to < b_to) {
      ++a;
    } else {
      ++b;
    }
  }
}

// Calls unite(component of a, component of b) for all pairs of runs that touch. b's tile lies
// `offset` tiles from a's, at most one along each axis, and not at the same place.
template <typename Unite>
void for_each_contact(const TileRuns& a, const TileRuns& b, const std::array<int, 3>& offset,
                      Neighbors neighbors, Unite&& unite) {
  constexpr int kSide = limits::kTileSide;
  // The rows of a that may touch b.
  const auto from = [](int along) { return along > 0 ? kSide - 1 : 0; };
  const auto to = [](int along) { return along < 0 ? 1 : kSide; };
  for (int z = from(offset[2]); z < to(offset[2]); ++z) {
    for (int y = from(offset[1]); y < to(offset[1]); ++y) {
      const auto row = static_cast<size_t>(z) * kSide + static_cast<size_t>(y);
      if (a.row_firsts[row] == a.row_firsts[row + 1]) continue;
      for (int dz = -1; dz <= 1; ++dz) {
        for (int dy = -1; dy <= 1; ++dy) {
          const int slack = contact_slack(dy, dz, neighbors);
          const int bz = z + dz - offset[2] * kSide, by = y + dy - offset[1] * kSide;
          if (slack < 0 || bz < 0 || bz >= kSide || by < 0 || by >= kSide) continue;
          const auto other = static_cast<size_t>(bz) * kSide + static_cast<size_t>(by);
          for_each_touch(
              a.runs, a.row_firsts[row], a.row_firsts[row + 1], b.runs, b.row_firsts[other],
              b.row_firsts[other + 1], offset[0] * kSide, slack,
              [&](uint32_t i, uint32_t j) { unite(a.runs[i].component, b.runs[j].component); });
        }
      }
    }
  }
}

}  // namespace voxeld
