#include "server/voxel/solid/distance.h"

#include <algorithm>

namespace voxeld {
namespace {

// Squared distances along one row for the cells from `first` on. False where nothing is set.
bool distances_of_row(std::span<const uint8_t> row, int first, std::span<uint32_t> out) {
  const auto size = static_cast<int>(row.size()), side = static_cast<int>(out.size());
  if (std::ranges::find(row, uint8_t{1}) == row.end()) return false;
  constexpr int kFar = 1 << 15;
  int nearest = kFar;
  for (int x = 0; x < first + side; ++x) {
    nearest = row[static_cast<size_t>(x)] != 0 ? 0 : std::min(nearest + 1, kFar);
    if (x >= first) out[static_cast<size_t>(x - first)] = static_cast<uint32_t>(nearest);
  }
  nearest = kFar;
  for (int x = size - 1; x >= first; --x) {
    nearest = row[static_cast<size_t>(x)] != 0 ? 0 : std::min(nearest + 1, kFar);
    if (x >= first + side) continue;
    uint32_t& distance = out[static_cast<size_t>(x - first)];
    distance = std::min(distance, static_cast<uint32_t>(nearest));
    distance *= distance;
  }
  return true;
}

// The lower envelope of the parabolas f(i) + (x - i)^2 of scratch.line, at first to first + side -
// 1, into scratch.result. False where no f is known.
bool envelope(int first, int side, DistanceScratch& scratch) {
  const std::span<const uint32_t> f = scratch.line;
  scratch.apex.resize(f.size());
  scratch.from.resize(f.size());
  int top = -1;
  const auto value = [&](int64_t i, int64_t x) {
    return static_cast<int64_t>(f[static_cast<size_t>(i)]) + (x - i) * (x - i);
  };
  for (int u = 0; u < static_cast<int>(f.size()); ++u) {
    if (f[static_cast<size_t>(u)] == kNoDistance) continue;
    const auto place = [&](int at) { return static_cast<size_t>(at); };
    while (top >= 0 && value(scratch.apex[place(top)], scratch.from[place(top)]) >
                           value(u, scratch.from[place(top)])) {
      --top;
    }
    int from = 0;
    if (top >= 0) {
      const int64_t i = scratch.apex[place(top)];
      // The last place where i is not above u; both sides are integers, and the quotient is >= 0.
      const int64_t numerator =
          int64_t{u} * u - i * i + int64_t{f[place(u)]} - int64_t{f[static_cast<size_t>(i)]};
      from = static_cast<int>(
          std::min<int64_t>(numerator / (2 * (u - i)) + 1, static_cast<int64_t>(f.size())));
      if (from >= static_cast<int>(f.size())) continue;
    }
    ++top;
    scratch.apex[place(top)] = u;
    scratch.from[place(top)] = from;
  }
  if (top < 0) return false;
  int at = top;
  for (int x = first + side - 1; x >= first; --x) {
    while (scratch.from[static_cast<size_t>(at)] > x) --at;
    scratch.result[static_cast<size_t>(x - first)] =
        static_cast<uint32_t>(value(scratch.apex[static_cast<size_t>(at)], x));
  }
  return true;
}

// Distances in the plane z, for rows first.y on, into scratch.of_planes.
void distances_of_plane(const DistanceBox& box, int z,
                        const std::function<void(int, int, std::span<uint8_t>)>& fill_row,
                        DistanceScratch& scratch) {
  const auto side = static_cast<size_t>(box.side);
  const auto rows = static_cast<size_t>(box.size.y);
  scratch.of_rows.assign(rows * side, kNoDistance);
  bool any = false;
  for (int y = 0; y < box.size.y; ++y) {
    fill_row(y, z, scratch.row);
    const bool found =
        distances_of_row(scratch.row, box.first.x,
                         std::span(scratch.of_rows).subspan(static_cast<size_t>(y) * side, side));
    any = any || found;
  }
  if (!any) return;
  uint32_t* plane = &scratch.of_planes[static_cast<size_t>(z) * side * side];
  scratch.line.resize(rows);
  for (size_t x = 0; x < side; ++x) {
    for (size_t y = 0; y < rows; ++y) scratch.line[y] = scratch.of_rows[y * side + x];
    if (!envelope(box.first.y, box.side, scratch)) continue;
    for (size_t y = 0; y < side; ++y) plane[y * side + x] = scratch.result[y];
  }
}

}  // namespace

void squared_distances(const DistanceBox& box,
                       const std::function<void(int, int, std::span<uint8_t>)>& fill_row,
                       DistanceScratch& scratch, std::vector<uint32_t>& out) {
  const auto side = static_cast<size_t>(box.side);
  const auto planes = static_cast<size_t>(box.size.z);
  scratch.row.resize(static_cast<size_t>(box.size.x));
  scratch.result.resize(side);
  scratch.of_planes.assign(planes * side * side, kNoDistance);
  for (int z = 0; z < box.size.z; ++z) distances_of_plane(box, z, fill_row, scratch);
  out.assign(side * side * side, kNoDistance);
  scratch.line.resize(planes);
  for (size_t cell = 0; cell < side * side; ++cell) {
    for (size_t z = 0; z < planes; ++z) scratch.line[z] = scratch.of_planes[z * side * side + cell];
    if (!envelope(box.first.z, box.side, scratch)) continue;
    for (size_t z = 0; z < side; ++z) out[z * side * side + cell] = scratch.result[z];
  }
}

}  // namespace voxeld
