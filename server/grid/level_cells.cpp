#include "server/grid/level_cells.h"

#include <algorithm>
#include <cmath>

#include "server/grid/color/color_tables.h"

namespace voxeld {

void IdCounts::add(uint16_t id, uint64_t cells) {
  if (id == 0) return;
  const auto at = std::ranges::lower_bound(counts_, id, {}, &std::pair<uint16_t, uint64_t>::first);
  if (at != counts_.end() && at->first == id) {
    at->second += cells;
  } else {
    counts_.insert(at, {id, cells});
  }
}

void IdCounts::add(const IdCounts& other) {
  for (const auto& [id, cells] : other.counts_) add(id, cells);
}

uint16_t IdCounts::most_frequent() const {
  std::pair<uint16_t, uint64_t> best{};
  for (const auto& one : counts_) {
    if (one.second > best.second) best = one;
  }
  return best.first;
}

void LevelSums::add(const VoxelValues& values) {
  ++valued;
  distance += values.distance;
  is_measured |= values.distance != 0;
  coverage += values.coverage;
  materials.add(values.material);
  labels.add(values.label);
  if (values.color != VoxelValues{}.color) {
    const auto& linear = linear16_from_srgb8();
    ++colored;
    const uint64_t alpha = values.color[3];
    for (size_t c = 0; c < 3; ++c) color[c] += alpha * linear[values.color[c]];
    color[3] += alpha;
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
  valued += other.valued;
  distance += other.distance;
  is_measured |= other.is_measured;
  coverage += other.coverage;
  materials.add(other.materials);
  labels.add(other.labels);
  for (size_t c = 0; c < color.size(); ++c) color[c] += other.color[c];
  for (size_t c = 0; c < normal.size(); ++c) normal[c] += other.normal[c];
}

VoxelValues LevelSums::mean(int level, bool is_solid) const {
  VoxelValues values;
  if (cells > 0) {
    // Voxels without attributes are entirely inside a solid, so their coverage is 255.
    const uint64_t sum = coverage + 255 * (cells - valued);
    const uint64_t whole = uint64_t{1} << ((is_solid ? 3 : 2) * level);
    values.coverage = static_cast<uint8_t>(std::min<uint64_t>(255, (sum + whole / 2) / whole));
  }
  if (valued > 0) {
    const double count = static_cast<double>(valued);
    const double steps = std::ldexp(static_cast<double>(distance) / count, -level);
    values.distance = static_cast<int16_t>(std::floor(steps + 0.5));
    // 0 has no sign.
    if (values.distance == 0 && is_measured) values.distance = distance < 0 ? -1 : 1;
    values.material = materials.most_frequent();
    values.label = labels.most_frequent();
  }
  if (colored > 0) {
    const auto& srgb8 = srgb8_from_linear16();
    const uint64_t alpha = color[3];
    values.color = {255, 255, 255, static_cast<uint8_t>((alpha + colored / 2) / colored)};
    for (size_t c = 0; c < 3 && values.color[3] != 0; ++c) {
      values.color[c] = srgb8[static_cast<size_t>((color[c] + alpha / 2) / alpha)];
    }
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
  if (!tile.has_attributes()) return;
  for (size_t i = first; i < first + count; ++i) sums.add(values_of(tile, i));
}

}  // namespace voxeld
