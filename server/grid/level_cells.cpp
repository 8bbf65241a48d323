#include "server/grid/level_cells.h"

#include <cmath>

#include "server/grid/color_tables.h"

namespace voxeld {

void LevelSums::add(const VoxelValues& values) {
  if (values.color != VoxelValues{}.color) {
    const auto& linear = linear16_from_srgb8();
    ++colored;
    for (size_t c = 0; c < 3; ++c) color[c] += linear[values.color[c]];
    color[3] += values.color[3];
  }
  if (values.normal != VoxelValues{}.normal) {
    ++directed;
    for (size_t c = 0; c < 3; ++c) normal[c] += values.normal[c];
  }
}

void LevelSums::add(const LevelSums& other) {
  cells += other.cells;
  colored += other.colored;
  directed += other.directed;
  for (size_t c = 0; c < color.size(); ++c) color[c] += other.color[c];
  for (size_t c = 0; c < normal.size(); ++c) normal[c] += other.normal[c];
}

VoxelValues LevelSums::mean() const {
  VoxelValues values;
  if (colored > 0) {
    const auto& srgb8 = srgb8_from_linear16();
    for (size_t c = 0; c < 3; ++c) {
      values.color[c] = srgb8[static_cast<size_t>((color[c] + colored / 2) / colored)];
    }
    values.color[3] = static_cast<uint8_t>((color[3] + colored / 2) / colored);
  }
  std::array<double, 3> v{};
  for (size_t c = 0; c < 3; ++c) v[c] = static_cast<double>(normal[c]);
  const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  if (length > 0 && length >= 0.127 * static_cast<double>(directed)) {
    for (size_t c = 0; c < 3; ++c) {
      values.normal[c] = static_cast<int8_t>(std::floor(127.0 * v[c] / length + 0.5));
    }
  }
  return values;
}

void add_values(const SparseTile& tile, size_t first, size_t count, LevelSums& sums) {
  if (tile.color.empty() && tile.normal.empty()) return;
  for (size_t i = first; i < first + count; ++i) sums.add(values_of(tile, i));
}

}  // namespace voxeld
