// Other programs' voxelizers, to be timed beside voxeld's in one run.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/scene/core/scene.h"

namespace voxeld::bench {

// A mesh in grid space: the longest side of its box is `size` cells, its low corner is at 0.
struct GridMesh {
  int size = 0;
  std::vector<float> positions;  // 3 per vertex
  std::vector<int> indices;      // 3 per triangle
};

GridMesh grid_mesh(const Scene& scene, int size);

// A rival. Functions that it does not have are empty.
struct Rival {
  using Count = std::function<uint64_t(const GridMesh&)>;

  std::string name;
  // Voxelize the surface, or surface and inside. They return the number of voxels, or of what the
  // rival has instead.
  Count surface = nullptr, solid = nullptr;
  // Signed distances of what is at most three voxels from the surface. Returns the number of
  // voxels.
  Count band = nullptr;
  // Voxelizes the surface and writes it to a file in the rival's own format, or as plain bits.
  std::function<void(const GridMesh&, const std::string& path)> save = nullptr;
};

// Only those that are installed are compiled.
Rival recast_rival();
Rival openvdb_rival();
Rival vtk_rival();

}  // namespace voxeld::bench
