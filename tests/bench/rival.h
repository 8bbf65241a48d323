// Other programs' voxelizers, to be timed beside voxeld's in one run.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace voxeld::bench {

// A mesh in grid space: the longest side of its box is `size` cells, its low corner is at 0.
struct GridMesh {
  int size = 0;
  std::vector<float> positions;  // 3 per vertex
  std::vector<int> indices;      // 3 per triangle
};

struct Rival {
  std::string name;
  // Voxelizes the surface. Returns the number of voxels, or of what it has instead.
  std::function<uint64_t(const GridMesh&)> run;
};

// Only those that are installed are compiled.
Rival recast_rival();
Rival openvdb_rival();

}  // namespace voxeld::bench
