#include "server/formats/vdb/tree_writer.h"

#include <algorithm>
#include <utility>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"

namespace voxeld::vdb {
namespace {

constexpr size_t kBatchNodesPerThread = 2;  // lower nodes made together

enum ValueCode : uint8_t { kBackground = 0, kMinusBackground = 1, kSelected = 3 };

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

}  // namespace

template <typename Value>
TreeWriter<Value>::TreeWriter(const TreeOrder& order, const GridValues<Value>& values)
    : nodes_(order, values) {}

template <typename Value>
Bytes TreeWriter<Value>::root_topology() const {
  const std::vector<Cell> tiles = nodes_.inside_roots();
  Bytes out;
  put(out, uint32_t{1});
  put(out, nodes_.values().background);
  put(out, static_cast<uint32_t>(tiles.size()));
  put(out, static_cast<uint32_t>(nodes_.order().uppers().size()));
  for (const Cell& cell : tiles) {
    put(out, cell);
    put(out, minus(nodes_.values().background));
    put(out, uint8_t{0});  // not active
  }
  return out;
}

template <typename Value>
Bytes TreeWriter<Value>::upper_topology(const UpperPlace& place) const {
  const UpperNode<Value> upper = nodes_.upper_of(place);
  Bytes out;
  put(out, place.cell);
  put(out, upper.children.words);
  put(out, upper.tiles.words);
  put_values<kUpperLog2, Value>(out, upper.children, upper.tiles, upper.inside, upper.tile_values);
  return out;
}

template <typename Value>
Bytes TreeWriter<Value>::lower_topology(const LowerPlace& place) const {
  const LowerNode<Value> lower = nodes_.lower_within(place);
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
    const Leaf<Value> leaf(nodes_.values(), *place.tile, at);
    if (leaf.is_uniform()) continue;  // a tile
    const LeafMask inside = nodes_.inside_of(place, at, leaf);
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
      if (!nodes_.summary(begin + i).is_tile) parts[i] = make(nodes_.order().lowers()[begin + i]);
    });
    for (const Bytes& part : parts) VOXELD_TRY(file.append(part));
  }
  return {};
}

template <typename Value>
Status TreeWriter<Value>::write_topology(OutputFile& file) const {
  VOXELD_TRY(file.append(root_topology()));
  for (const UpperPlace& upper : nodes_.order().uppers()) {
    VOXELD_TRY(file.append(upper_topology(upper)));
    VOXELD_TRY(append_lowers(file, upper,
                             [this](const LowerPlace& place) { return lower_topology(place); }));
  }
  return {};
}

template <typename Value>
Status TreeWriter<Value>::write_leaves(OutputFile& file) const {
  for (const UpperPlace& upper : nodes_.order().uppers()) {
    VOXELD_TRY(append_lowers(file, upper,
                             [this](const LowerPlace& place) { return leaf_buffers(place); }));
  }
  return {};
}

template class TreeWriter<float>;
template class TreeWriter<Vec3s>;
template class TreeWriter<int32_t>;

}  // namespace voxeld::vdb
