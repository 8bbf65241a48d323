#include "server/voxel/solid/distance/distance.h"

#include <algorithm>

#include "server/base/cancel_point.h"

namespace voxeld {
namespace {

// Squared distances along one row for the cells from `first` on. False if no cell is set.
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

// Evaluates the lower envelope of scratch.line at first to first + side - 1, into scratch.result.
// False if no distance is known.
bool envelope(int first, int side, DistanceScratch& scratch) {
  if (!scratch.envelope.build(scratch.line)) return false;
  const auto begin = static_cast<uint32_t>(first);
  scratch.envelope.visit(begin, begin + static_cast<uint32_t>(side), [&](uint32_t x, uint32_t i) {
    scratch.result[x - begin] = scratch.envelope.value(i, x);
  });
  return true;
}

// Distances within plane z, for rows from first.y on, into scratch.of_planes.
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
  for (int z = 0; z < box.size.z; ++z) {
    cancel_point();
    distances_of_plane(box, z, fill_row, scratch);
  }
  out.assign(side * side * side, kNoDistance);
  scratch.line.resize(planes);
  for (size_t cell = 0; cell < side * side; ++cell) {
    cancel_point();
    for (size_t z = 0; z < planes; ++z) scratch.line[z] = scratch.of_planes[z * side * side + cell];
    if (!envelope(box.first.z, box.side, scratch)) continue;
    for (size_t z = 0; z < side; ++z) out[z * side * side + cell] = scratch.result[z];
  }
}

}  // namespace voxeld
