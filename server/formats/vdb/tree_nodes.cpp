#include "server/formats/vdb/tree_nodes.h"

#include <algorithm>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"

namespace voxeld::vdb {
namespace {

bool is_inside(float value) {
  return value < 0;
}
template <typename Value>
bool is_inside(const Value& /*value*/) {
  return false;
}

template <size_t kLog2Side>
NodeMask<kLog2Side> known_of(const NodeMask<kLog2Side>& children,
                             const NodeMask<kLog2Side>& tiles) {
  NodeMask<kLog2Side> known;
  for (size_t w = 0; w < known.words.size(); ++w)
    known.words[w] = children.words[w] | tiles.words[w];
  return known;
}

ActiveVoxels voxels_of_cube(const Cell& cell, int32_t side) {
  const auto cells = static_cast<uint64_t>(side);
  return {
      cells * cells * cells, cell, {cell[0] + side - 1, cell[1] + side - 1, cell[2] + side - 1}};
}

template <typename Value>
void add_tile(LowerNode<Value>& lower, const LowerPlace& place, size_t slot, const Value& value) {
  lower.tiles.set(slot);
  lower.first.set(slot, is_inside(value));
  lower.last.set(slot, is_inside(value));
  lower.tile_values.emplace_back(slot, value);
  const Cell cell = entry_cell(place.cell, LowerMask::entry(slot), kLeafSide);
  lower.active.add(voxels_of_cube(cell, kLeafSide));
}

template <typename Value>
void add_leaf(LowerNode<Value>& lower, const LowerPlace& place, const LeafPlace& leaf,
              const LeafMask& mask) {
  lower.children.set(leaf.slot);
  lower.leaves.push_back(leaf);
  lower.active.add(voxels_of(mask, entry_cell(place.cell, LowerMask::entry(leaf.slot), kLeafSide)));
}

}  // namespace

void ActiveVoxels::add(const ActiveVoxels& voxels) {
  count += voxels.count;
  for (size_t c = 0; c < 3; ++c) {
    min[c] = std::min(min[c], voxels.min[c]);
    max[c] = std::max(max[c], voxels.max[c]);
  }
}

ActiveVoxels voxels_of(const LeafMask& mask, const Cell& cell) {
  uint64_t all = 0;
  Cell first{INT32_MAX, 0, 0}, last{};
  for (size_t x = 0; x < mask.words.size(); ++x) {
    if (mask.words[x] == 0) continue;
    first[0] = std::min(first[0], static_cast<int32_t>(x));
    last[0] = static_cast<int32_t>(x);
    all |= mask.words[x];
  }
  first[1] = std::countr_zero(all) / kLeafSide;
  last[1] = (63 - std::countl_zero(all)) / kLeafSide;
  uint64_t row = all | all >> 32;
  row |= row >> 16;
  row = (row | row >> 8) & 0xff;
  first[2] = std::countr_zero(row);
  last[2] = 63 - std::countl_zero(row);
  ActiveVoxels voxels;
  for (size_t c = 0; c < 3; ++c) {
    voxels.min[c] = cell[c] + first[c];
    voxels.max[c] = cell[c] + last[c];
  }
  voxels.count = mask.count();
  return voxels;
}

template <typename Value>
Leaf<Value>::Leaf(const GridValues<Value>& source, const SparseTile& tile, const LeafPlace& place)
    : mask(leaf_mask(*place.mask)), count(mask.count()) {
  std::array<Value, LeafMask::kBits> by_morton, by_bit;
  source.fill(tile, place.attribute, {by_morton.data(), count});
  size_t next = 0;
  for (size_t w = 0; w < place.mask->words.size(); ++w) {
    for (uint64_t bits = place.mask->words[w]; bits != 0; bits &= bits - 1) {
      by_bit[leaf_bit(64 * w + static_cast<size_t>(std::countr_zero(bits)))] = by_morton[next++];
    }
  }
  next = 0;
  mask.for_each([&](size_t bit) { values[next++] = by_bit[bit]; });
}

template <typename Value>
bool Leaf<Value>::is_uniform() const {
  if (count < LeafMask::kBits) return false;
  return std::ranges::all_of(values, [&](const Value& v) { return has_same_bits(v, values[0]); });
}

template <typename Value>
LeafMask Leaf<Value>::negatives() const {
  LeafMask negatives;
  size_t next = 0;
  mask.for_each([&](size_t bit) { negatives.set(bit, is_inside(values[next++])); });
  return negatives;
}

template <typename Value>
TreeNodes<Value>::TreeNodes(const TreeOrder& order, const GridValues<Value>& values)
    : order_(order), values_(values), summaries_(order.lowers().size()) {
  ThreadPool::shared().for_each(summaries_.size(), [&](size_t i) {
    cancel_point();  // on the calling thread
    summaries_[i] = summary_of(order_.lowers()[i]);
  });
  for (const Summary& summary : summaries_) active_.add(summary.active);
}

template <typename Value>
LowerNode<Value> TreeNodes<Value>::lower_of(const LowerPlace& place) const {
  LowerNode<Value> lower;
  place.full_bricks().for_each([&](size_t slot) { add_tile(lower, place, slot, values_.inner); });
  for (const LeafPlace& at : place.leaves()) {
    const LeafMask mask = leaf_mask(*at.mask);
    if (mask.count() == LeafMask::kBits || values_.is_signed) {
      const Leaf<Value> leaf(values_, *place.tile, at);
      if (leaf.is_uniform()) {
        add_tile(lower, place, at.slot, leaf.values[0]);
        continue;
      }
      if (values_.is_signed) {
        const LeafMask negatives = leaf.negatives();
        const LeafMask inside = flood_signs(mask, negatives, negatives);
        const Cell cell = entry_cell(place.cell, LowerMask::entry(at.slot), kLeafSide);
        const size_t end = last_bit<kLeafLog2>(order_.sides_within(cell, 1));
        lower.first.set(at.slot, negatives.test(0) || inside.test(0));
        lower.last.set(at.slot, negatives.test(end) || inside.test(end));
      }
    }
    add_leaf(lower, place, at, mask);
  }
  std::ranges::sort(lower.tile_values, {}, &std::pair<size_t, Value>::first);
  if (values_.is_signed) {
    lower.inside = flood_signs(known_of(lower.children, lower.tiles), lower.first, lower.last);
  }
  return lower;
}

template <typename Value>
LowerNode<Value> TreeNodes<Value>::lower_within(const LowerPlace& place) const {
  LowerNode<Value> lower = lower_of(place);
  keep_within(lower.inside, order_.sides_within(place.cell, kLeafSide));
  return lower;
}

template <typename Value>
LeafMask TreeNodes<Value>::inside_of(const LowerPlace& lower, const LeafPlace& place,
                                     const Leaf<Value>& leaf) const {
  if (!values_.is_signed) return {};
  const LeafMask negatives = leaf.negatives();
  LeafMask inside = flood_signs(leaf.mask, negatives, negatives);
  const Cell cell = entry_cell(lower.cell, LowerMask::entry(place.slot), kLeafSide);
  keep_within(inside, order_.sides_within(cell, 1));
  return inside;
}

template <typename Value>
typename TreeNodes<Value>::Summary TreeNodes<Value>::summary_of(const LowerPlace& place) const {
  Summary summary;
  if (place.is_full) {
    const bool inside = is_inside(values_.inner);
    return {true, values_.inner, inside, inside, voxels_of_cube(place.cell, kLowerSide)};
  }
  const LowerNode<Value> lower = lower_of(place);
  const size_t end = last_bit<kLowerLog2>(order_.sides_within(place.cell, kLeafSide));
  summary.first_inside = lower.first.test(0) || lower.inside.test(0);
  summary.last_inside = lower.last.test(end) || lower.inside.test(end);
  summary.active = lower.active;
  if (lower.tile_values.size() < LowerMask::kBits) return summary;
  summary.tile = lower.tile_values.front().second;
  summary.is_tile = std::ranges::all_of(lower.tile_values, [&](const auto& entry) {
    return has_same_bits(entry.second, summary.tile);
  });
  return summary;
}

template <typename Value>
UpperNode<Value> TreeNodes<Value>::upper_of(const UpperPlace& place) const {
  UpperNode<Value> upper;
  UpperMask first, last;
  for (size_t i = place.begin; i < place.end; ++i) {
    const Summary& summary = summaries_[i];
    const size_t slot = order_.lowers()[i].slot;
    first.set(slot, summary.first_inside);
    last.set(slot, summary.last_inside);
    if (summary.is_tile) {
      upper.tiles.set(slot);
      upper.tile_values.push_back(summary.tile);
    } else {
      upper.children.set(slot);
    }
  }
  if (!values_.is_signed) return upper;
  upper.inside = flood_signs(known_of(upper.children, upper.tiles), first, last);
  const Cell sides = order_.sides_within(place.cell, kLowerSide);
  const size_t end = last_bit<kUpperLog2>(sides);
  upper.first_inside = first.test(0) || upper.inside.test(0);
  upper.last_inside = last.test(end) || upper.inside.test(end);
  keep_within(upper.inside, sides);
  return upper;
}

template <typename Value>
std::vector<Cell> TreeNodes<Value>::inside_roots() const {
  std::vector<Cell> cells;
  if (!values_.is_signed || order_.uppers().empty()) return cells;
  RootMask known, first, last;
  for (const UpperPlace& place : order_.uppers()) {
    std::array<size_t, 3> at{};
    for (size_t c = 0; c < 3; ++c) at[c] = static_cast<size_t>(place.cell[c] / kUpperSide);
    const size_t slot = RootMask::bit(at[0], at[1], at[2]);
    const UpperNode<Value> upper = upper_of(place);
    known.set(slot);
    first.set(slot, upper.first_inside);
    last.set(slot, upper.last_inside);
  }
  RootMask inside = flood_signs(known, first, last);
  keep_within(inside, order_.sides_within({}, kUpperSide));
  inside.for_each(
      [&](size_t slot) { cells.push_back(entry_cell({}, RootMask::entry(slot), kUpperSide)); });
  return cells;
}

template struct Leaf<float>;
template struct Leaf<Vec3s>;
template struct Leaf<int32_t>;

template class TreeNodes<float>;
template class TreeNodes<Vec3s>;
template class TreeNodes<int32_t>;

}  // namespace voxeld::vdb
