// Winding numbers along columns, from the crossings of a window in ascending order of each column.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/base/cancel_point.h"
#include "server/voxel/solid/inside/crossings.h"

namespace voxeld {

class ColumnWinding {
 public:
  // Sorts the crossings. It keeps its memory between calls.
  void set(std::span<const Crossing> crossings, const ColumnWindow& window);

  // Appends a crossing wherever inside(winding number) changes along a column. The parity of the
  // appended crossings is then inside(winding number). inside(0) must be false.
  template <typename Inside>
  void append_changes(const Inside& inside, std::vector<Crossing>& out) const {
    for (size_t i = 0; i < sorted_.size();) {
      cancel_point();
      const uint32_t column = crossing_column(sorted_[i]);
      bool was_inside = false;
      for (int winding = 0; i < sorted_.size() && crossing_column(sorted_[i]) == column;) {
        const int cell = crossing_cell(sorted_[i]);
        for (; i < sorted_.size() && crossing_column(sorted_[i]) == column &&
               crossing_cell(sorted_[i]) == cell;
             ++i) {
          winding += crossing_winding(sorted_[i]);
        }
        if (inside(winding) == was_inside) continue;
        was_inside = !was_inside;
        out.push_back(make_crossing(column, cell, was_inside));
      }
    }
  }

  // Winding number at the centre of a cell. u and v count from the window's corner.
  int at(int u, int v, int cell) const;

 private:
  std::vector<Crossing> sorted_;    // by column (v, then u), then first cell
  std::vector<uint32_t> first_of_;  // first crossing of each column, then the total
};

}  // namespace voxeld
