// Places the models of a MagicaVoxel file by its scene graph.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/volumes/vox_chunks.h"

namespace voxeld::volumes {

// A model in the scene. Cell v of the model covers the scene's cell
// sign * v[axis] + first, for each of the axes x, y, z.
struct VoxInstance {
  size_t model = 0;  // its number in the file
  std::array<uint8_t, 3> axis{0, 1, 2};
  std::array<int8_t, 3> sign{1, 1, 1};
  std::array<int64_t, 3> first{};
  // Cells of the model in the scene, [min, max).
  std::array<int64_t, 3> min{}, max{};
};

struct VoxScene {
  std::vector<VoxInstance> instances;  // in the order of the graph, which decides overlaps
  uint64_t hidden_count = 0;           // nodes that are not shown, their children not counted
  bool has_graph = false;              // without one, the first model stands at the corner 0
};

// Longest path from the root to a shape, in nodes. Longer: malformed-mesh. It bounds recursion, and
// files whose nodes form a cycle.
inline constexpr int kVoxDepthMax = 64;
// Nodes that are visited; a node that several others name is visited for each. More:
// malformed-mesh.
inline constexpr uint64_t kVoxVisitsMax = uint64_t{1} << 20;

// Errors: malformed-mesh for nodes and models that the file lacks, and for the limits above.
Result<VoxScene> place_vox_models(std::string_view name, const VoxFile& file);

}  // namespace voxeld::volumes
