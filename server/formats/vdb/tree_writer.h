// Writes the tree of a VDB grid: first the topology of all nodes, then the values of all leaves.
//
//   root      u32 1, value background, u32 tiles, u32 upper nodes; tiles: i32[3] first cell, value,
//             u8 active; upper nodes: i32[3] first cell, then the node
//   upper     mask of children, mask of active tiles, values of the entries, then its lower nodes
//   lower     likewise, then its leaves
//   leaf      mask of active voxels; among the values of leaves: the mask again, then its values
//
//   values    u8 code, selection mask (code 3), block of the values of active tiles or voxels by
//             ascending bit. Code: what the others are
//     0  background
//     1  minus the background
//     3  background where the selection mask is set, elsewhere minus the background
//
// A mask has a bit for each entry as u64 words. A brick, or a lower node, that is full of equal
// values is an active tile. So the inside of a solid without attributes costs next to nothing.
//
// The format is that of OpenVDB 10, compression "zip + active values":
// https://github.com/AcademySoftwareFoundation/openvdb (io/Compression.h, tree/*Node.h). K. Museth,
// VDB: High-Resolution Sparse Volumes with Dynamic Topology, ACM TOG 32(3), 2013.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "proto/result.h"
#include "server/formats/output_file.h"
#include "server/formats/vdb/bytes.h"
#include "server/formats/vdb/grid_values.h"
#include "server/formats/vdb/tree_order.h"

namespace voxeld::vdb {

// The active voxels of a tree.
struct ActiveVoxels {
  uint64_t count = 0;
  Cell min{INT32_MAX, INT32_MAX, INT32_MAX};  // as OpenVDB writes the box of no voxels
  Cell max{INT32_MIN, INT32_MIN, INT32_MIN};  // the last one

  void add(const ActiveVoxels& voxels);
};

// Value: float, Vec3s or int32_t.
template <typename Value>
class TreeWriter {
 public:
  // Both outlive the writer.
  TreeWriter(const TreeOrder& order, const GridValues<Value>& values);

  const ActiveVoxels& active() const { return active_; }
  // Errors of these: storage-full, internal.
  Status write_topology(OutputFile& file) const;
  Status write_leaves(OutputFile& file) const;

 private:
  // A lower node as its upper node sees it.
  struct Summary {
    bool is_tile = false;
    Value tile{};
    bool first_inside = false, last_inside = false;
    ActiveVoxels active;
  };
  struct Lower;
  struct Upper {
    UpperMask children, tiles, inside;
    std::vector<Value> tile_values;  // by ascending bit
    bool last_inside = false;        // its last cell
  };

  Lower lower_of(const LowerPlace& place) const;
  Summary summary_of(const LowerPlace& place) const;
  Upper upper_of(const UpperPlace& place) const;
  std::vector<Cell> inside_roots() const;
  Bytes root_topology() const;
  Bytes upper_topology(const UpperPlace& place) const;
  Bytes lower_topology(const LowerPlace& place) const;
  Bytes leaf_buffers(const LowerPlace& place) const;
  template <typename Make>
  Status append_lowers(OutputFile& file, const UpperPlace& upper, const Make& make) const;

  const TreeOrder& order_;
  const GridValues<Value>& values_;
  std::vector<Summary> summaries_;  // of the order's lower nodes
  ActiveVoxels active_;
};

}  // namespace voxeld::vdb
