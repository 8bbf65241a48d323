#include "server/formats/vdb/tree_writer.h"

#include <algorithm>
#include <array>
#include <bit>
#include <utility>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"

namespace voxeld::vdb {
namespace {

constexpr size_t kBatchNodesPerThread = 2;  // lower nodes made together

enum ValueCode : uint8_t { kBackground = 0, kMinusBackground = 1, kSelected = 3 };

// By their bits: a block of equal values is one whose bytes repeat.
template <typename Value>
bool is_equal(const Value& a, const Value& b) {
  using Bytes = std::array<uint8_t, sizeof(Value)>;
  return std::bit_cast<Bytes>(a) == std::bit_cast<Bytes>(b);
}

bool is_inside(float value) {
  return value < 0;
}
template <typename Value>
bool is_inside(const Value& /*value*/) {
  return false;
}

float negative(float value) {
  return -value;
}
template <typename Value>
Value negative(const Value& value) {
  return value;
}

template <typename Value>
std::span<const uint8_t> values_bytes(std::span<const Value> values) {
  return {reinterpret_cast<const uint8_t*>(values.data()), values.size_bytes()};
}

// inside: the entries that have minus the background, of those that are neither children nor
// active.
template <size_t kLog2Side, typename Value>
void put_values(Bytes& out, const NodeMask<kLog2Side>& children, const NodeMask<kLog2Side>& active,
                const NodeMask<kLog2Side>& inside, std::span<const Value> values) {
  NodeMask<kLog2Side> outside;
  for (size_t w = 0; w < outside.words.size(); ++w) {
    outside.words[w] = ~(children.words[w] | active.words[w] | inside.words[w]);
  }
  const ValueCode code = !inside.any() ? kBackground : outside.any() ? kSelected : kMinusBackground;
  put(out, static_cast<uint8_t>(code));
  if (code == kSelected) put(out, outside.words);
  put_block(out, values_bytes(values), sizeof(Value));
}

template <size_t kLog2Side>
NodeMask<kLog2Side> known_of(const NodeMask<kLog2Side>& children,
                             const NodeMask<kLog2Side>& tiles) {
  NodeMask<kLog2Side> known;
  for (size_t w = 0; w < known.words.size(); ++w)
    known.words[w] = children.words[w] | tiles.words[w];
  return known;
}

// The voxels of a leaf, by ascending bit of the mask.
template <typename Value>
struct Leaf {
  LeafMask mask;
  size_t count = 0;
  std::array<Value, LeafMask::kBits> values;

  Leaf(const GridValues<Value>& source, const SparseTile& tile, const LeafPlace& place) {
    mask = leaf_mask(*place.mask);
    count = mask.count();
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

  bool is_uniform() const {
    if (count < LeafMask::kBits) return false;
    return std::ranges::all_of(values, [&](const Value& v) { return is_equal(v, values[0]); });
  }
  // The active voxels inside.
  LeafMask negatives() const {
    LeafMask negatives;
    size_t next = 0;
    mask.for_each([&](size_t bit) { negatives.set(bit, is_inside(values[next++])); });
    return negatives;
  }
};

// The box of a leaf's voxels.
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

Cell entry_cell(const Cell& node, const Cell& entry, int32_t entry_side) {
  return {node[0] + entry_side * entry[0], node[1] + entry_side * entry[1],
          node[2] + entry_side * entry[2]};
}

ActiveVoxels voxels_of_cube(const Cell& cell, int32_t side) {
  const auto cells = static_cast<uint64_t>(side);
  return {
      cells * cells * cells, cell, {cell[0] + side - 1, cell[1] + side - 1, cell[2] + side - 1}};
}

}  // namespace

void ActiveVoxels::add(const ActiveVoxels& voxels) {
  count += voxels.count;
  for (size_t c = 0; c < 3; ++c) {
    min[c] = std::min(min[c], voxels.min[c]);
    max[c] = std::max(max[c], voxels.max[c]);
  }
}

// A lower node without the values of its leaves.
template <typename Value>
struct TreeWriter<Value>::Lower {
  LowerMask children, tiles, inside;
  LowerMask first, last;                              // of which the first and last cell is inside
  std::vector<std::pair<size_t, Value>> tile_values;  // by ascending bit
  std::vector<LeafPlace> leaves;                      // the children
  ActiveVoxels active;

  void add_tile(const LowerPlace& place, size_t slot, const Value& value) {
    tiles.set(slot);
    first.set(slot, is_inside(value));
    last.set(slot, is_inside(value));
    tile_values.emplace_back(slot, value);
    active.add(
        voxels_of_cube(entry_cell(place.cell, LowerMask::entry(slot), kLeafSide), kLeafSide));
  }
  void add_leaf(const LowerPlace& place, const LeafPlace& leaf, const LeafMask& mask) {
    children.set(leaf.slot);
    leaves.push_back(leaf);
    active.add(voxels_of(mask, entry_cell(place.cell, LowerMask::entry(leaf.slot), kLeafSide)));
  }
};

template <typename Value>
TreeWriter<Value>::TreeWriter(const TreeOrder& order, const GridValues<Value>& values)
    : order_(order), values_(values), summaries_(order.lowers().size()) {
  ThreadPool::shared().for_each(summaries_.size(), [&](size_t i) {
    cancel_point();  // on the calling thread
    summaries_[i] = summary_of(order_.lowers()[i]);
  });
  for (const Summary& summary : summaries_) active_.add(summary.active);
}

template <typename Value>
typename TreeWriter<Value>::Lower TreeWriter<Value>::lower_of(const LowerPlace& place) const {
  Lower lower;
  place.full_bricks().for_each([&](size_t slot) { lower.add_tile(place, slot, values_.inner); });
  for (const LeafPlace& at : place.leaves()) {
    const LeafMask mask = leaf_mask(*at.mask);
    if (mask.count() == LeafMask::kBits || values_.is_signed) {
      const Leaf<Value> leaf(values_, *place.tile, at);
      if (leaf.is_uniform()) {
        lower.add_tile(place, at.slot, leaf.values[0]);
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
    lower.add_leaf(place, at, mask);
  }
  std::ranges::sort(lower.tile_values, {}, &std::pair<size_t, Value>::first);
  if (values_.is_signed) {
    lower.inside = flood_signs(known_of(lower.children, lower.tiles), lower.first, lower.last);
  }
  return lower;
}

template <typename Value>
typename TreeWriter<Value>::Summary TreeWriter<Value>::summary_of(const LowerPlace& place) const {
  Summary summary;
  if (place.is_full) {
    const bool inside = is_inside(values_.inner);
    return {true, values_.inner, inside, inside, voxels_of_cube(place.cell, kLowerSide)};
  }
  const Lower lower = lower_of(place);
  const size_t end = last_bit<kLowerLog2>(order_.sides_within(place.cell, kLeafSide));
  summary.first_inside = lower.first.test(0) || lower.inside.test(0);
  summary.last_inside = lower.last.test(end) || lower.inside.test(end);
  summary.active = lower.active;
  if (lower.tile_values.size() < LowerMask::kBits) return summary;
  summary.tile = lower.tile_values.front().second;
  summary.is_tile = std::ranges::all_of(
      lower.tile_values, [&](const auto& entry) { return is_equal(entry.second, summary.tile); });
  return summary;
}

template <typename Value>
typename TreeWriter<Value>::Upper TreeWriter<Value>::upper_of(const UpperPlace& place) const {
  Upper upper;
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
  upper.last_inside = last.test(end) || upper.inside.test(end);
  keep_within(upper.inside, sides);
  return upper;
}

// The first cells of tiles of the root inside of the surface: between two upper nodes along z.
template <typename Value>
std::vector<Cell> TreeWriter<Value>::inside_roots() const {
  std::vector<Cell> cells;
  const std::vector<UpperPlace>& uppers = order_.uppers();
  for (size_t i = 0; values_.is_signed && i + 1 < uppers.size(); ++i) {
    Cell cell = uppers[i].cell;
    const Cell& next = uppers[i + 1].cell;
    if (next[0] != cell[0] || next[1] != cell[1] || !upper_of(uppers[i]).last_inside) continue;
    for (cell[2] += kUpperSide; cell[2] < next[2]; cell[2] += kUpperSide) cells.push_back(cell);
  }
  return cells;
}

template <typename Value>
Bytes TreeWriter<Value>::root_topology() const {
  const std::vector<Cell> tiles = inside_roots();
  Bytes out;
  put(out, uint32_t{1});
  put(out, values_.background);
  put(out, static_cast<uint32_t>(tiles.size()));
  put(out, static_cast<uint32_t>(order_.uppers().size()));
  for (const Cell& cell : tiles) {
    put(out, cell);
    put(out, negative(values_.background));
    put(out, uint8_t{0});  // not active
  }
  return out;
}

template <typename Value>
Bytes TreeWriter<Value>::upper_topology(const UpperPlace& place) const {
  const Upper upper = upper_of(place);
  Bytes out;
  put(out, place.cell);
  put(out, upper.children.words);
  put(out, upper.tiles.words);
  put_values<kUpperLog2, Value>(out, upper.children, upper.tiles, upper.inside, upper.tile_values);
  return out;
}

template <typename Value>
Bytes TreeWriter<Value>::lower_topology(const LowerPlace& place) const {
  Lower lower = lower_of(place);
  keep_within(lower.inside, order_.sides_within(place.cell, kLeafSide));
  std::vector<Value> tile_values;
  tile_values.reserve(lower.tile_values.size());
  for (const auto& [slot, value] : lower.tile_values) tile_values.push_back(value);
  Bytes out;
  put(out, lower.children.words);
  put(out, lower.tiles.words);
  put_values<kLowerLog2, Value>(out, lower.children, lower.tiles, lower.inside, tile_values);
  for (const LeafPlace& leaf : lower.leaves) put(out, leaf_mask(*leaf.mask).words);
  return out;
}

template <typename Value>
Bytes TreeWriter<Value>::leaf_buffers(const LowerPlace& place) const {
  Bytes out;
  for (const LeafPlace& at : place.leaves()) {
    const Leaf<Value> leaf(values_, *place.tile, at);
    if (leaf.is_uniform()) continue;  // a tile
    LeafMask inside;
    if (values_.is_signed) {
      const LeafMask negatives = leaf.negatives();
      inside = flood_signs(leaf.mask, negatives, negatives);
      const Cell cell = entry_cell(place.cell, LowerMask::entry(at.slot), kLeafSide);
      keep_within(inside, order_.sides_within(cell, 1));
    }
    put(out, leaf.mask.words);
    put_values<kLeafLog2, Value>(out, LeafMask(), leaf.mask, inside,
                                 {leaf.values.data(), leaf.count});
  }
  return out;
}

// Appends what make() returns for the lower nodes of an upper node.
template <typename Value>
template <typename Make>
Status TreeWriter<Value>::append_lowers(OutputFile& file, const UpperPlace& upper,
                                        const Make& make) const {
  const size_t batch = kBatchNodesPerThread * ThreadPool::shared().threads();
  for (size_t begin = upper.begin; begin < upper.end; begin += batch) {
    std::vector<Bytes> parts(std::min(batch, upper.end - begin));
    ThreadPool::shared().for_each(parts.size(), [&](size_t i) {
      cancel_point();  // on the calling thread
      if (!summaries_[begin + i].is_tile) parts[i] = make(order_.lowers()[begin + i]);
    });
    for (const Bytes& part : parts) VOXELD_TRY(file.append(part));
  }
  return {};
}

template <typename Value>
Status TreeWriter<Value>::write_topology(OutputFile& file) const {
  VOXELD_TRY(file.append(root_topology()));
  for (const UpperPlace& upper : order_.uppers()) {
    VOXELD_TRY(file.append(upper_topology(upper)));
    VOXELD_TRY(append_lowers(file, upper,
                             [this](const LowerPlace& place) { return lower_topology(place); }));
  }
  return {};
}

template <typename Value>
Status TreeWriter<Value>::write_leaves(OutputFile& file) const {
  for (const UpperPlace& upper : order_.uppers()) {
    VOXELD_TRY(append_lowers(file, upper,
                             [this](const LowerPlace& place) { return leaf_buffers(place); }));
  }
  return {};
}

template class TreeWriter<float>;
template class TreeWriter<Vec3s>;
template class TreeWriter<int32_t>;

}  // namespace voxeld::vdb
