#include "server/voxel/solid/inside/column_winding.h"

#include <algorithm>

#include "server/base/cancel_point.h"
#include "server/base/in_pieces.h"

namespace voxeld {
namespace {

// The sort key of a column's crossings. Most columns have few, for which insertion is fastest.
uint32_t height_key(Crossing c) {
  return c >> 16 & 0x7fffu;
}

void sort_column(Crossing* first, Crossing* last) {
  if (last - first > 32) {
    std::sort(first, last, [](Crossing a, Crossing b) { return height_key(a) < height_key(b); });
    return;
  }
  for (Crossing* next = first + 1; next < last; ++next) {
    const Crossing moved = *next;
    Crossing* place = next;
    for (; place > first && height_key(place[-1]) > height_key(moved); --place) *place = place[-1];
    *place = moved;
  }
}

}  // namespace

void ColumnWinding::set(std::span<const Crossing> crossings, const ColumnWindow& window) {
  const size_t columns = static_cast<size_t>(window.v_count) << 8;
  first_of_.assign(columns + 1, 0);
  for_each_in_pieces(crossings, [&](Crossing c) { ++first_of_[crossing_column(c) + 1]; });
  for (size_t i = 0; i < columns; ++i) first_of_[i + 1] += first_of_[i];
  sorted_.resize(crossings.size());
  for_each_in_pieces(crossings, [&](Crossing c) { sorted_[first_of_[crossing_column(c)]++] = c; });
  // Shifted by one, every entry now says where its column begins.
  for (size_t i = columns; i > 0; --i) first_of_[i] = first_of_[i - 1];
  first_of_[0] = 0;
  for (size_t i = 0; i < columns; ++i) {
    cancel_point();
    if (first_of_[i + 1] - first_of_[i] > 1) {
      sort_column(sorted_.data() + first_of_[i], sorted_.data() + first_of_[i + 1]);
    }
  }
}

int ColumnWinding::at(int u, int v, int cell) const {
  const size_t column = static_cast<size_t>(v) << 8 | static_cast<size_t>(u);
  int winding = 0;
  for (uint32_t i = first_of_[column]; i < first_of_[column + 1]; ++i) {
    if (crossing_cell(sorted_[i]) > cell) break;
    winding += crossing_winding(sorted_[i]);
  }
  return winding;
}

}  // namespace voxeld
