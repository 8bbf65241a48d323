// The nodes of a NanoVDB grid, in memory and in a file.
//
//   grid     672 bytes, nvdb.cpp
//   tree     u64[4] offsets from here of the first leaf, lower node, upper node (0: there is none)
//            and of the root; u32[3] leaves, lower and upper nodes; u32[3] active tiles of lower
//            nodes, upper nodes and the root; u64 active voxels
//   root     i32[3] first and i32[3] last active voxel, u32 tiles, value background, statistics;
//            tiles
//     tile   u64 key, i64 offset of an upper node from the root or 0, u32 active, value; by key
//   upper    i32[3] first and last active voxel, u64 flags, mask of active tiles, mask of children,
//            statistics; for each entry a value, or the i64 offset of a lower node from this node
//   lower    likewise, with the offsets of leaves
//   leaf     i32[3] first active voxel, u8[3] last one minus that, u8 flags, mask of active voxels,
//            statistics; 512 values
//
//   statistics   of active voxels: values minimum and maximum, f32 mean, f32 standard deviation.
//                Vectors are compared by their squared length, of which these two are as well
//   flags        2: the node has active voxels
//   key          x / 4096 << 42 | y / 4096 << 21 | z / 4096
//
// Each of these, and each table of values, is padded with zeros to a multiple of 32 bytes. Masks
// have a bit for each entry as u64 words. All upper nodes are followed by all lower ones, these by
// all leaves.
//
// The format is that of version 32.4.2: https://github.com/AcademySoftwareFoundation/openvdb
// (nanovdb/NanoVDB.h of OpenVDB 10). K. Museth, NanoVDB: A GPU-Friendly and Portable VDB Data
// Structure for Real-Time Rendering and Simulation, SIGGRAPH 2021 Talks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "proto/result.h"
#include "server/formats/vdb/bytes.h"
#include "server/formats/vdb/tree_order.h"

namespace voxeld::vdb {

constexpr size_t nano_aligned(size_t bytes) {
  return (bytes + 31) / 32 * 32;
}

inline constexpr size_t kNanoGridBytes = 672, kNanoTreeBytes = 64;
inline constexpr uint32_t kNanoHasVoxels = 2;  // flag of a node

template <typename Value>
struct NanoLayout {
  static constexpr size_t kStatisticsBytes = 2 * sizeof(Value) + 2 * sizeof(float);
  // An entry of an inner node: a value or an offset, aligned to 8 bytes.
  static constexpr size_t kEntryBytes = (sizeof(Value) + 7) / 8 * 8;
  static constexpr size_t kRootBytes = nano_aligned(28 + sizeof(Value) + kStatisticsBytes);
  static constexpr size_t kTileBytes = nano_aligned(20 + sizeof(Value));

  template <size_t kLog2Side>
  static constexpr size_t node_bytes() {
    const size_t bits = NodeMask<kLog2Side>::kBits;
    return nano_aligned(32 + 2 * bits / 8 + kStatisticsBytes) + bits * kEntryBytes;
  }
  static constexpr size_t kUpperBytes = node_bytes<kUpperLog2>();
  static constexpr size_t kLowerBytes = node_bytes<kLowerLog2>();
  static constexpr size_t kLeafBytes =
      nano_aligned(16 + LeafMask::kBits / 8 + kStatisticsBytes) + LeafMask::kBits * sizeof(Value);
};
static_assert(NanoLayout<float>::kLeafBytes == 2144 && NanoLayout<float>::kLowerBytes == 33856 &&
              NanoLayout<float>::kUpperBytes == 270400);

// Leaves of a grid, whose nodes the tree counts in 32 bits: grid-too-large.
inline constexpr uint64_t kNanoLeavesMax = UINT32_MAX;

inline Status check_nano_leaves(uint64_t leaves) {
  if (leaves <= kNanoLeavesMax) return {};
  return Error{ErrorCode::kGridTooLarge, "nvdb: too many bricks of 8x8x8 cells",
               "at most " + std::to_string(kNanoLeavesMax), std::to_string(leaves)};
}

// Appends zeros up to the next multiple of 32 bytes.
inline void pad_nano(Bytes& out) {
  out.resize(nano_aligned(out.size()));
}

}  // namespace voxeld::vdb
