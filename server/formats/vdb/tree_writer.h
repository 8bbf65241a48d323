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
// A mask has a bit for each entry as u64 words. tree_nodes.h chooses the nodes.
//
// The format is that of OpenVDB 10, compression "zip + active values":
// https://github.com/AcademySoftwareFoundation/openvdb (io/Compression.h, tree/*Node.h). K. Museth,
// VDB: High-Resolution Sparse Volumes with Dynamic Topology, ACM TOG 32(3), 2013.
#pragma once

#include "proto/result.h"
#include "server/formats/output_file.h"
#include "server/formats/vdb/bytes.h"
#include "server/formats/vdb/grid_values.h"
#include "server/formats/vdb/tree_nodes.h"
#include "server/formats/vdb/tree_order.h"

namespace voxeld::vdb {

// Value: float, Vec3s or int32_t.
template <typename Value>
class TreeWriter {
 public:
  // Both outlive the writer.
  TreeWriter(const TreeOrder& order, const GridValues<Value>& values);

  const ActiveVoxels& active() const { return nodes_.active(); }
  // Errors of these: storage-full, internal.
  Status write_topology(OutputFile& file) const;
  Status write_leaves(OutputFile& file) const;

 private:
  Bytes root_topology() const;
  Bytes upper_topology(const UpperPlace& place) const;
  Bytes lower_topology(const LowerPlace& place) const;
  Bytes leaf_buffers(const LowerPlace& place) const;
  template <typename Make>
  Status append_lowers(OutputFile& file, const UpperPlace& upper, const Make& make) const;

  const TreeNodes<Value> nodes_;
};

}  // namespace voxeld::vdb
