// The tree of a NanoVDB grid; nano_layout.h has the byte maps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "proto/result.h"
#include "server/formats/vdb/bytes.h"
#include "server/formats/vdb/nano_layout.h"
#include "server/formats/vdb/nano_statistics.h"
#include "server/formats/vdb/tree_nodes.h"
#include "server/formats/zip/deflate_stream.h"

namespace voxeld::vdb {

struct NanoCounts {
  uint64_t leaves = 0, lowers = 0, uppers = 0;
  uint64_t lower_tiles = 0, upper_tiles = 0;  // active ones of these nodes
};

// Value: float, Vec3s or int32_t.
template <typename Value>
class NanoTree {
 public:
  // The nodes outlive the tree.
  explicit NanoTree(const TreeNodes<Value>& nodes);

  const NanoCounts& counts() const { return counts_; }
  // Bytes of the tree and root, and with the other nodes.
  size_t head_bytes() const;
  uint64_t bytes() const;
  // The tree and root.
  Bytes head() const;
  // Adds the other nodes. Returns the CRC-32 of the CRC-32 of each, as u64, in their order.
  // Errors: storage-full, internal.
  Result<uint32_t> write_nodes(DeflateStream& stream) const;

 private:
  using Layout = NanoLayout<Value>;
  using Statistics = NanoStatistics<Value>;

  // A lower node of the order that is no tile.
  struct Lower {
    size_t place = 0;         // in the order
    uint64_t leaf_begin = 0;  // the number of its first leaf
    uint64_t leaves = 0, tiles = 0;
    Statistics statistics{};
  };
  // Some leaves of a lower node: [begin, end).
  struct LeafRange {
    size_t lower = 0;
    size_t begin = 0, end = 0;
  };
  // An entry of the root.
  struct RootTile {
    Cell cell{};
    bool is_upper = false;
    size_t upper = 0;
  };
  using Sums = std::vector<uint32_t>;  // of the nodes of a piece

  void count(Lower& lower) const;
  std::vector<LeafRange> leaf_ranges() const;
  Statistics upper_statistics(size_t upper) const;
  uint64_t upper_offset(uint64_t number) const;  // offsets from the tree
  uint64_t lower_offset(uint64_t number) const;
  uint64_t leaf_offset(uint64_t number) const;
  void put_upper(Bytes& out, size_t upper) const;
  void put_lower(Bytes& out, size_t lower) const;
  void put_leaves(Bytes& out, const LeafRange& range, Sums& sums) const;
  template <typename Make>
  Status add_pieces(DeflateStream& stream, size_t count, uint32_t& sum, const Make& make) const;

  const TreeNodes<Value>& nodes_;
  std::vector<Lower> lowers_;
  std::vector<size_t> lower_begins_;  // by upper node, and the end: numbers of their lower nodes
  std::vector<RootTile> tiles_;
  NanoCounts counts_;
};

}  // namespace voxeld::vdb
