// The parts of a MagicaVoxel file that make voxels: models, nodes of the scene graph, hidden
// layers and colours. vox_chunks.cpp describes the layout.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "proto/result.h"

namespace voxeld::volumes {

// In the file z points up. Coordinates are those of the file until vox_file.cpp makes the grid.
struct VoxModel {
  std::array<int32_t, 3> size{};    // cells, each 1..kVoxModelSideMax
  std::span<const uint8_t> voxels;  // kVoxVoxelBytes each: x, y, z, number of the colour
};
inline constexpr size_t kVoxVoxelBytes = 4;
inline constexpr size_t kVoxCancelVoxels = size_t{1} << 16;  // between two cancellation points
inline constexpr int kVoxModelSideMax = 256;                 // cells have coordinates of one byte

// p_parent[c] = sign[c] * p_child[axis[c]] + offset[c], of points at the corners of cells.
struct VoxTransform {
  std::array<uint8_t, 3> axis{0, 1, 2};  // a permutation
  std::array<int8_t, 3> sign{1, 1, 1};   // mirrors are allowed
  std::array<int64_t, 3> offset{};       // cells
};

enum class VoxNodeKind { kTransform, kGroup, kShape };

struct VoxNode {
  VoxNodeKind kind = VoxNodeKind::kTransform;
  bool is_hidden = false;
  int32_t id = 0;
  int32_t layer = -1;                 // of a transform; -1: none
  VoxTransform transform;             // of a transform
  std::span<const uint8_t> children;  // i32 ids of nodes, of transforms (one) and groups
  int32_t model = 0;                  // of a shape: that of the first frame
};

// Where a file of voxeld's own says that its grid lies (server/formats/vox_parts.cpp).
struct VoxPlacement {
  std::array<int32_t, 3> dims{};  // cells of the grid, y up
  std::array<double, 3> origin{}, voxel_size{};
};

struct VoxFile {
  std::vector<VoxModel> models;
  std::vector<VoxNode> nodes;          // ascending by id
  std::vector<int32_t> hidden_layers;  // ascending
  // sRGB R, G, B and linear A by colour number; 0 is not used.
  std::array<std::array<uint8_t, 4>, 256> colors{};
  std::optional<VoxPlacement> placement;
  bool has_frames = false;    // a node has more than one
  size_t trailing_bytes = 0;  // after the chunk MAIN

  // Null for an unknown id.
  const VoxNode* find_node(int32_t id) const;
  bool is_hidden_layer(int32_t layer) const;
};

// Reads the chunks, and checks the cells of all models. The result points into `bytes`. Errors:
// malformed-mesh.
Result<VoxFile> read_vox_chunks(std::string_view name, std::span<const uint8_t> bytes);

}  // namespace voxeld::volumes
