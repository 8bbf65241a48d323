#include "server/formats/vdb/nano_tree.h"

#include <libdeflate.h>

#include <algorithm>
#include <array>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"

namespace voxeld::vdb {

// The entries of a node: offsets of children, values of tiles. It has a name outside of this file
// because lambdas in members of NanoTree capture it.
template <typename Value>
class NanoEntries {
 public:
  // Values of neither: the background, or minus it inside.
  template <size_t kLog2Side>
  NanoEntries(const Value& background, const NodeMask<kLog2Side>& inside)
      : bytes_(NodeMask<kLog2Side>::kBits * kEntry) {
    for (size_t bit = 0; bit < NodeMask<kLog2Side>::kBits; ++bit) set(bit, background);
    inside.for_each([&](size_t bit) { set(bit, minus(background)); });
  }

  void set(size_t bit, const Value& value) { write(bit, bytes_of(value)); }
  void set_child(size_t bit, uint64_t offset) {
    std::fill_n(bytes_.begin() + static_cast<std::ptrdiff_t>(bit * kEntry), kEntry, uint8_t{0});
    write(bit, bytes_of(offset));
  }
  const Bytes& bytes() const { return bytes_; }

 private:
  static constexpr size_t kEntry = NanoLayout<Value>::kEntryBytes;

  void write(size_t bit, std::span<const uint8_t> bytes) {
    std::ranges::copy(bytes, bytes_.begin() + static_cast<std::ptrdiff_t>(bit * kEntry));
  }

  Bytes bytes_;
};

namespace {

// Nodes of a piece, which a thread makes and deflates between two cancellation points.
constexpr size_t kPieceLowers = 4, kPieceLeaves = 512;
constexpr size_t kPiecesTogether = 64;  // whose checksums are in memory
constexpr uint64_t kLeafVoxels = 512, kLowerVoxels = kLeafVoxels << 12;
constexpr size_t kNanoRootAt = kNanoTreeBytes;  // from the tree

uint32_t crc_of(std::span<const uint8_t> bytes) {
  return libdeflate_crc32(0, bytes.data(), bytes.size());
}

uint64_t root_key(const Cell& cell) {
  const auto part = [&](size_t c) { return static_cast<uint64_t>(cell[c] / kUpperSide); };
  return part(0) << 42 | part(1) << 21 | part(2);
}

// Appends an upper or lower node.
template <typename Value, size_t kLog2Side>
void put_inner_node(Bytes& out, const ActiveVoxels& active, const NodeMask<kLog2Side>& tiles,
                    const NodeMask<kLog2Side>& children, const NanoStatistics<Value>& statistics,
                    const NanoEntries<Value>& table) {
  put(out, active.min);
  put(out, active.max);
  put(out, uint64_t{kNanoHasVoxels});
  put(out, tiles.words);
  put(out, children.words);
  put_statistics(out, statistics);
  pad_nano(out);
  out.insert(out.end(), table.bytes().begin(), table.bytes().end());
}

template <typename Value>
NanoStatistics<Value> leaf_statistics(const Leaf<Value>& leaf) {
  NanoStatistics<Value> statistics;
  for (size_t i = 0; i < leaf.count; ++i) statistics.add(leaf.values[i]);
  return statistics;
}

}  // namespace

template <typename Value>
NanoTree<Value>::NanoTree(const TreeNodes<Value>& nodes) : nodes_(nodes) {
  const std::vector<UpperPlace>& uppers = nodes.order().uppers();
  counts_.uppers = uppers.size();
  for (size_t u = 0; u < uppers.size(); ++u) {
    lower_begins_.push_back(lowers_.size());
    tiles_.push_back({uppers[u].cell, true, u});
    for (size_t i = uppers[u].begin; i < uppers[u].end; ++i) {
      if (nodes.summary(i).is_tile) {
        ++counts_.upper_tiles;
      } else {
        lowers_.push_back({.place = i});
      }
    }
  }
  lower_begins_.push_back(lowers_.size());
  for (const Cell& cell : nodes.inside_roots()) tiles_.push_back({cell});
  std::ranges::sort(tiles_, {}, &RootTile::cell);
  ThreadPool::shared().for_each(lowers_.size(), [&](size_t i) {
    cancel_point();  // on the calling thread
    count(lowers_[i]);
  });
  counts_.lowers = lowers_.size();
  for (Lower& lower : lowers_) {
    lower.leaf_begin = counts_.leaves;
    counts_.leaves += lower.leaves;
    counts_.lower_tiles += lower.tiles;
  }
}

template <typename Value>
void NanoTree<Value>::count(Lower& lower) const {
  const LowerPlace& place = nodes_.order().lowers()[lower.place];
  const LowerNode<Value> node = nodes_.lower_of(place);
  lower.leaves = node.leaves.size();
  lower.tiles = node.tile_values.size();
  for (const auto& [slot, value] : node.tile_values) lower.statistics.add(value, kLeafVoxels);
  for (const LeafPlace& leaf : node.leaves) {
    lower.statistics.add(leaf_statistics(Leaf<Value>(nodes_.values(), *place.tile, leaf)));
  }
}

template <typename Value>
typename NanoTree<Value>::Statistics NanoTree<Value>::upper_statistics(size_t upper) const {
  Statistics statistics;
  const UpperPlace& place = nodes_.order().uppers()[upper];
  for (size_t i = place.begin; i < place.end; ++i) {
    const auto& summary = nodes_.summary(i);
    if (summary.is_tile) statistics.add(summary.tile, kLowerVoxels);
  }
  for (size_t i = lower_begins_[upper]; i < lower_begins_[upper + 1]; ++i) {
    statistics.add(lowers_[i].statistics);
  }
  return statistics;
}

template <typename Value>
size_t NanoTree<Value>::head_bytes() const {
  return kNanoTreeBytes + Layout::kRootBytes + tiles_.size() * Layout::kTileBytes;
}
template <typename Value>
uint64_t NanoTree<Value>::upper_offset(uint64_t number) const {
  return head_bytes() + number * Layout::kUpperBytes;
}
template <typename Value>
uint64_t NanoTree<Value>::lower_offset(uint64_t number) const {
  return upper_offset(counts_.uppers) + number * Layout::kLowerBytes;
}
template <typename Value>
uint64_t NanoTree<Value>::leaf_offset(uint64_t number) const {
  return lower_offset(counts_.lowers) + number * Layout::kLeafBytes;
}
template <typename Value>
uint64_t NanoTree<Value>::bytes() const {
  return leaf_offset(counts_.leaves);
}

template <typename Value>
Bytes NanoTree<Value>::head() const {
  Bytes out;
  put(out, counts_.leaves > 0 ? leaf_offset(0) : 0);
  put(out, counts_.lowers > 0 ? lower_offset(0) : 0);
  put(out, counts_.uppers > 0 ? upper_offset(0) : 0);
  put(out, uint64_t{kNanoRootAt});
  for (const uint64_t nodes : {counts_.leaves, counts_.lowers, counts_.uppers}) {
    put(out, static_cast<uint32_t>(nodes));
  }
  for (const uint64_t tiles : {counts_.lower_tiles, counts_.upper_tiles, uint64_t{0}}) {
    put(out, static_cast<uint32_t>(tiles));
  }
  put(out, nodes_.active().count);
  const Value& background = nodes_.values().background;
  Statistics statistics = Statistics::of_none(background);
  for (size_t u = 0; u < counts_.uppers; ++u) statistics.add(upper_statistics(u));
  put(out, nodes_.active().min);
  put(out, nodes_.active().max);
  put(out, static_cast<uint32_t>(tiles_.size()));
  put(out, background);
  put_statistics(out, statistics);
  pad_nano(out);
  for (const RootTile& tile : tiles_) {
    put(out, root_key(tile.cell));
    put(out, tile.is_upper ? upper_offset(tile.upper) - kNanoRootAt : 0);
    put(out, uint32_t{0});  // tiles of the root are not active
    put(out, tile.is_upper ? Value{} : minus(background));
    pad_nano(out);
  }
  return out;
}

template <typename Value>
void NanoTree<Value>::put_upper(Bytes& out, size_t upper) const {
  const UpperPlace& place = nodes_.order().uppers()[upper];
  const UpperNode<Value> node = nodes_.upper_of(place);
  NanoEntries<Value> table(nodes_.values().background, node.inside);
  size_t tile = 0, child = lower_begins_[upper];
  node.tiles.for_each([&](size_t bit) { table.set(bit, node.tile_values[tile++]); });
  node.children.for_each(
      [&](size_t bit) { table.set_child(bit, lower_offset(child++) - upper_offset(upper)); });
  ActiveVoxels active;
  for (size_t i = place.begin; i < place.end; ++i) active.add(nodes_.summary(i).active);
  put_inner_node(out, active, node.tiles, node.children, upper_statistics(upper), table);
}

template <typename Value>
void NanoTree<Value>::put_lower(Bytes& out, size_t lower) const {
  const Lower& of = lowers_[lower];
  const LowerNode<Value> node = nodes_.lower_within(nodes_.order().lowers()[of.place]);
  NanoEntries<Value> table(nodes_.values().background, node.inside);
  for (const auto& [slot, value] : node.tile_values) table.set(slot, value);
  uint64_t child = of.leaf_begin;
  node.children.for_each(
      [&](size_t bit) { table.set_child(bit, leaf_offset(child++) - lower_offset(lower)); });
  put_inner_node(out, node.active, node.tiles, node.children, of.statistics, table);
}

template <typename Value>
void NanoTree<Value>::put_leaves(Bytes& out, const LeafRange& range, Sums& sums) const {
  const LowerPlace& lower = nodes_.order().lowers()[lowers_[range.lower].place];
  const std::vector<LeafPlace> places = nodes_.lower_of(lower).leaves;
  const Value background = nodes_.values().background;
  std::array<Value, LeafMask::kBits> cells;
  for (size_t i = range.begin; i < range.end; ++i) {
    const Leaf<Value> leaf(nodes_.values(), *lower.tile, places[i]);
    const Cell cell = entry_cell(lower.cell, LowerMask::entry(places[i].slot), kLeafSide);
    const ActiveVoxels active = voxels_of(leaf.mask, cell);
    const size_t begin = out.size();
    put(out, active.min);
    for (size_t c = 0; c < 3; ++c) put(out, static_cast<uint8_t>(active.max[c] - active.min[c]));
    put(out, uint8_t{kNanoHasVoxels});
    put(out, leaf.mask.words);
    put_statistics(out, leaf_statistics(leaf));
    pad_nano(out);
    cells.fill(background);
    nodes_.inside_of(lower, places[i], leaf).for_each([&](size_t bit) {
      cells[bit] = minus(background);
    });
    size_t next = 0;
    leaf.mask.for_each([&](size_t bit) { cells[bit] = leaf.values[next++]; });
    put(out, cells);
    sums.push_back(crc_of(std::span(out).subspan(begin)));
  }
}

template <typename Value>
std::vector<typename NanoTree<Value>::LeafRange> NanoTree<Value>::leaf_ranges() const {
  std::vector<LeafRange> ranges;
  for (size_t i = 0; i < lowers_.size(); ++i) {
    cancel_point();
    for (size_t begin = 0; begin < lowers_[i].leaves; begin += kPieceLeaves) {
      ranges.push_back({i, begin, std::min<size_t>(begin + kPieceLeaves, lowers_[i].leaves)});
    }
  }
  return ranges;
}

// make(i, bytes, sums) replaces the bytes by those of piece i.
template <typename Value>
template <typename Make>
Status NanoTree<Value>::add_pieces(DeflateStream& stream, size_t count, uint32_t& sum,
                                   const Make& make) const {
  for (size_t begin = 0; begin < count; begin += kPiecesTogether) {
    std::vector<Sums> sums(std::min(kPiecesTogether, count - begin));
    VOXELD_TRY(stream.add_pieces(
        sums.size(),
        [&](size_t i, Bytes& out) {
          out.clear();
          make(begin + i, out, sums[i]);
        },
        Repeats::anywhere()));
    for (const Sums& of_piece : sums) {
      for (const uint64_t of_node : of_piece) {
        sum = libdeflate_crc32(sum, &of_node, sizeof of_node);
      }
    }
  }
  return {};
}

template <typename Value>
Result<uint32_t> NanoTree<Value>::write_nodes(DeflateStream& stream) const {
  uint32_t sum = 0;
  VOXELD_TRY(add_pieces(stream, counts_.uppers, sum, [&](size_t i, Bytes& out, Sums& sums) {
    put_upper(out, i);
    sums.push_back(crc_of(out));
  }));
  const size_t lower_pieces = (lowers_.size() + kPieceLowers - 1) / kPieceLowers;
  VOXELD_TRY(add_pieces(stream, lower_pieces, sum, [&](size_t i, Bytes& out, Sums& sums) {
    const size_t end = std::min((i + 1) * kPieceLowers, lowers_.size());
    for (size_t lower = i * kPieceLowers; lower < end; ++lower) {
      put_lower(out, lower);
      sums.push_back(crc_of(std::span(out).last(Layout::kLowerBytes)));
    }
  }));
  const std::vector<LeafRange> ranges = leaf_ranges();
  VOXELD_TRY(add_pieces(stream, ranges.size(), sum, [&](size_t i, Bytes& out, Sums& sums) {
    put_leaves(out, ranges[i], sums);
  }));
  return sum;
}

template class NanoTree<float>;
template class NanoTree<Vec3s>;
template class NanoTree<int32_t>;

}  // namespace voxeld::vdb
